# Check a course, fly it, look at it.
airrace check sprint.yaml
airrace optimize sprint.yaml --until point-mass --guess plan --search off
airrace show sprint.h5 --legs
airrace report sprint.h5
