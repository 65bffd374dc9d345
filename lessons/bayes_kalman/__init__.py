"""Lessons for the Bayesian reading of the Kalman filter: Bayes' theorem, MAP and MMSE, the gain, a simulation."""
