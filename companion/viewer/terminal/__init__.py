"""The viewer's picture on the terminal: of a run over ssh, and of the simulator.

``sketch`` says what each dot of a map shows, ``screen`` how all is laid out; ``known`` is what a companion knows of its
drive, ``run_view`` how a run is followed; ``painter`` draws without delaying anybody.
"""
