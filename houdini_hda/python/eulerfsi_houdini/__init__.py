"""The Python code of the Houdini asset, which holds no solver code: the dialog and the geometry of a node become a USD
scene, and the eulerfsi command line tool simulates it in a process of its own."""
