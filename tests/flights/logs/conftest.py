"""Nothing but its place: with it `synthetic.py` can be imported by the tests beside it."""
