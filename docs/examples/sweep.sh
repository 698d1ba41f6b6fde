# One course under three load factors, ranked, as a table and as JUnit.
airrace batch half_cuban_eight --sweep rules.n_z_max=8,9,10 --set settings.guess=plan --set settings.search=off \
    --until point-mass --csv n_z.csv --junit n_z.xml
