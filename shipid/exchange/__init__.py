"""The law of exchange: the error of a prediction over physics, runs and cost, learned from many ships."""
