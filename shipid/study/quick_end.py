"""Ends a process without taking down what it has imported. Only the process that workers fork from imports this."""

import atexit
import os

atexit.register(os._exit, 0)  # taking PyTorch down takes 0.4 s, in which a pipe of the command's output stays open
