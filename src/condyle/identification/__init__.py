"""Which machine is it really: the numbers of a mechanism's file from logs of a real one."""
