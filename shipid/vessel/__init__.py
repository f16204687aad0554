"""From a document to equations: read a vessel, perturb it, assemble its dynamics."""
