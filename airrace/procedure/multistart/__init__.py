"""The search among routes: which of the many local optima is the fastest flight.

The joint problem has many local optima: a turn flat or over the top, to the left or to the right, a pylon rounded one
way or the other, a reversal before or behind its gate. Several plans are solved coarsely, the best of them is changed
stretch by stretch where another way is proposed, and what wins is flown as a whole again.
"""
