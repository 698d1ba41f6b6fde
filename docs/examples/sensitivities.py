"""What does each number of the rules cost, in milliseconds per usual step?"""

import airrace

run = airrace.optimize("half_cuban_eight", until="point-mass", guess="plan")
print(run.sensitivities(by="rules"))
