"""What flies, where and in what air: frames, aircraft, environment, course, dynamics."""
