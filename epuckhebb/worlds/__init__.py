"""Any environment of Gymnasium as a world: readings, actions, lifetimes, and changes in the middle of one."""
