"""Plasticity: how weights change during a lifetime.

A rule gives the direction of each weight's change (`rule.Rule`). The rate is the same for all weights: N_e = N g
max(0.2, F), the base rate N times the need for plasticity and the live fitness (`update`). Controls change the signs of
the updates (`control`); `weight_change` measures the result. To add a rule, write a file in `rules/`, or anywhere and
give `hebbian.rule=my_rules.py:Oja`.
"""
