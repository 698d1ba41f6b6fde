# The same flight for other programs.
airrace optimize half_cuban_eight --until point-mass --guess plan --search off --output run.h5
airrace export csv run.h5 --rate 50 --output run.csv
airrace export acmi run.h5 --origin 48.1,11.6,500
airrace export kml run.h5 --origin 48.1,11.6,500
airrace export geojson run.h5 --origin 48.1,11.6,500
