"""Quadratic programs: ProxSuite and DAQP behind one interface."""
