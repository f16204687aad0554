"""Published equations of simulators' ships, written out in the variables and units of their sources.

They were written before the vessel documents, and know nothing of them. `DRAWN` holds what is drawn: velocities
[m/s, rad/s], heel [rad] and orders in the units of the source; `accelerations` takes them by name.
"""
