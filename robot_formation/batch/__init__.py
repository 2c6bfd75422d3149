"""Much independent work: a pool of processes, a table that grows with the results, how far it is."""
