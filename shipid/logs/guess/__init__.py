"""What the columns of an unknown log are: names give candidates, kinematics decide, defects are named."""
