"""A ROS 1 node of our own: no installation of ROS is needed, only the extra ``ros`` (message definitions and codec).

It knows nothing of urbiscript.  Reading order: ``errors``, ``names``, ``framing`` (bytes of TCPROS), ``messages`` (a
message as a dictionary, and its bytes), ``definitions`` (types that the library does not have), ``rpc`` (XML-RPC over
HTTP, both ends), ``master`` (what the master is asked), ``streams`` (TCPROS connections), ``publications``,
``subscriptions``, ``services``, and ``node``, which holds them together and comes back after the master was lost.

``worker`` is the process that has a node and obeys the ``orders`` of a kernel through a socket; ``urbihw.ros.script``,
``Ros`` of urbiscript, is the kernel's end of it.  ``urbihw.ros.robot`` makes a robot of ours a node.

Everything that comes from the network is untrusted: sizes are bounded before memory is taken, each connection has a
time-out, and what a peer does not read is dropped.  A node listens on the loopback interface unless ``ROS_IP`` or
``ROS_HOSTNAME`` tell otherwise.

Source of the protocols: wiki.ros.org/ROS/Master_API, Slave_API and TCPROS, and bytes exchanged with ros_comm 1.15.
"""
