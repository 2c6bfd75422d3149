"""The lines that tell how a run is getting on, in the launcher or as a node of their own."""
