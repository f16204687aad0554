"""From a question to an answer: plan, run, store and read out a study."""
