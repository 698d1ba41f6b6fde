"""The process that the package runs in: threads and memory, interrupts, streams, shipped files, extensions."""
