"""Effects outside the catalogue: covariates on which the unexplained residual depends."""
