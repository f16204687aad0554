"""Published equations of simulators' ships, written out in the variables and units of their sources.

Each was written from its source by a person who had not read the vessel document. `DRAWN` holds what is drawn:
velocities [m/s, rad/s], heel [rad], outside forces [N, N m], and orders in the units of the source; `accelerations`
takes them by name.
"""
