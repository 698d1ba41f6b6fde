"""A course to be moved about, of three gates."""

COURSE = """\
# A course to be moved about.
schema: airrace/track/1
name: Three gates
aircraft: edge540
rules: {n_z_max: 10, floor_m: 10, start_speed_max_kt: 200}
gate_defaults: {height_m: 20, passing: window}
gates:
  start:  {type: level, north_m: 0, east_m: 0, heading_deg: 0}
  corner: {type: pylon, north_m: 420, east_m: 60, pass_side_deg: 270}   # the western side
  last:   {type: level, pylons: [{north_m: 700, east_m: 314}, {north_m: 688, east_m: 316}]}
course:
  start: start
  lap:
    - corner  # only once
    - last
"""
