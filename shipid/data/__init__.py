"""From logs to windows: a dataset and its schema, declared imports and repairs, checks, cutting, public sets."""
