"""Many runs: sweep, reproduction and leaderboard; which jobs there are, which are missing, and tables over all.

A study that is killed goes on where it stopped; `jobs` says how.
Others may import `sweep`, `reproduce`, `leaderboard`, `leaderboard_plan` and `jobs`.
"""
