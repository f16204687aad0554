"""Readers, mappings and importing of logs: from files of any kind to a dataset."""
