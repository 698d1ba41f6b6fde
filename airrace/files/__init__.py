"""What is read and written: inputs in YAML, run files in HDF5, exports."""
