"""The program around the science: configuration, run folders, Hydra, and the command line."""
