"""Nothing but its place: with it the flights here can be imported by the tests beside them."""
