"""Nothing but its place: with it the races and fidelities here can be imported by the tests in the folders below."""
