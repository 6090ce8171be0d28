"""What compiled kernels call while they run: geometry, contacts, gathering of observations, the ledger of threads."""
