"""Tests of urbihw.buses: links, the Dynamixel protocol, the cycle, the worker."""
