"""From the results of a study to its answer: evidence, findings, comparisons, sentences and pages."""
