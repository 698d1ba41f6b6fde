"""Aircraft of JSBSim, read from its XML: documents and units, functions, mass, aerodynamics, engines."""
