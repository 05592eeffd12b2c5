"""What the page cites, in the order of its list."""

from __future__ import annotations

REFERENCES = {
    "lecture": "V. Acary. Lecture 3: Solvers for the time-discretized problems. 8 June 2006.",
    "bonnans": "J. F. Bonnans, J. C. Gilbert, C. Lemaréchal, C. A. Sagastizábal. Numerical Optimization: Theoretical "
    "and Practical Aspects. Springer, 2003.",
    "cottle": "R. W. Cottle, J.-S. Pang, R. E. Stone. The Linear Complementarity Problem. Academic Press, 1992.",
    "fletcher87": "R. Fletcher. Practical Methods of Optimization. Wiley, 1987.",
    "fletcher93": "R. Fletcher. Resolving degeneracy in quadratic programming. Annals of Operations Research 46–47, "
    "307–334, 1993.",
    "murty": "K. G. Murty. Linear Complementarity, Linear and Nonlinear Programming. Heldermann, 1988.",
    "facchinei": "F. Facchinei, J.-S. Pang. Finite-Dimensional Variational Inequalities and Complementarity Problems. "
    "Springer, 2003.",
    "hock": "W. Hock, K. Schittkowski. Test Examples for Nonlinear Programming Codes. Springer, 1981.",
    "josephy": "N. H. Josephy. Newton's method for generalized equations. Technical Summary Report 1965, Mathematics "
    "Research Center, University of Wisconsin, 1979.",
    "kojima": "M. Kojima, S. Shindo. Extension of Newton and quasi-Newton methods to systems of PC¹ equations. "
    "Journal of the Operations Research Society of Japan 29, 352–375, 1986.",
    "robinson": "S. M. Robinson. Normal maps induced by linear transformations. Mathematics of Operations Research "
    "17, 691–714, 1992.",
    "harker": "P. T. Harker. Generalized Nash games and quasi-variational inequalities. European Journal of "
    "Operational Research 54, 81–94, 1991.",
    "fischer": "A. Fischer. A special Newton-type optimization method. Optimization 24, 269–284, 1992.",
    "penalized": "B. Chen, X. Chen, C. Kanzow. A penalized Fischer–Burmeister NCP-function. Mathematical Programming "
    "88, 211–216, 2000.",
    "evtushenko": "Yu. G. Evtushenko, V. A. Purtov. Sufficient conditions for a minimum for nonlinear programming "
    "problems. Soviet Mathematics Doklady 30, 313–316, 1984.",
    "saxce": "G. De Saxcé, Z.-Q. Feng. The bipotential method: a constructive approach to design the complete "
    "contact law with friction and improved numerical algorithms. Mathematical and Computer Modelling 28, "
    "225–245, 1998.",
    "stewart": "D. E. Stewart, J. C. Trinkle. An implicit time-stepping scheme for rigid body dynamics with "
    "inelastic collisions and Coulomb friction. International Journal for Numerical Methods in "
    "Engineering 39, 2673–2691, 1996.",
    "anitescu": "M. Anitescu, F. A. Potra. Formulating dynamic multi-rigid-body contact problems with friction as "
    "solvable linear complementarity problems. Nonlinear Dynamics 14, 231–247, 1997.",
    "tasora": "M. Anitescu, A. Tasora. An iterative approach for cone complementarity problems for nonsmooth "
    "dynamics. Computational Optimization and Applications 47, 207–235, 2010.",
    "cadoux": "V. Acary, F. Cadoux, C. Lemaréchal, J. Malick. A formulation of the linear discrete Coulomb friction "
    "problem via convex optimization. ZAMM 91, 155–175, 2011.",
    "rolling": "V. Acary, F. Bourrier. Coulomb friction with rolling resistance as a cone complementarity problem. "
    "European Journal of Mechanics A/Solids 85, 2021.",
}
"""Key -> the reference."""
