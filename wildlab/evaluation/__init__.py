"""Is a result accurate, and does it know how accurate it is? Errors, consistency, whiteness, pose noise."""
