"""The planners of the other papers: Sedighi 2004, Achour & Chaalal 2011 with PRM, Wang et al. 2007."""
