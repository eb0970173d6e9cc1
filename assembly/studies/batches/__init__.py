"""Many solves of one scene: rows of starts or of parameters, in compiled calls over threads."""
