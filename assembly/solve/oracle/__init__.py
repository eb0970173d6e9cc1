"""The same problem in CasADi, solved by IPOPT: an independent check."""
