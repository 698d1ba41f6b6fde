"""Nothing but its place: with it the races and ladders here can be imported by the tests in the folders below."""
