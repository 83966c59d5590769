// Torques of the exported solver: rows of joint positions, velocities and accelerations on stdin.
// Writes torques, M row by row, Coriolis, gravity and friction.
#include <iomanip>
#include <iostream>

#include "solver.hpp"

using namespace PACKAGE;

int main()
{
    const auto n = static_cast<Eigen::Index>(N);
    Eigen::VectorXd given[3] = {Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::VectorXd(n)};
    Solver solver;
    solver.initialize();
    std::cout << std::setprecision(17);
    for (;;) {
        for (auto & one : given)
            for (Eigen::Index i = 0; i < n; i++)
                if (!(std::cin >> one(i))) return 0;
        auto inertia = solver.getInertiaMatrix(given[0]);
        const auto print = [&](const Eigen::VectorXd & values) {
            for (Eigen::Index i = 0; i < n; i++) std::cout << values(i) << ' ';
        };
        print(solver.getTorques(given[0], given[1], given[2]));
        for (Eigen::Index i = 0; i < n; i++)
            for (Eigen::Index j = 0; j < n; j++) std::cout << inertia(i, j) << ' ';
        print(solver.getCoriolisVector(given[0], given[1]));
        print(solver.getGravityVector(given[0]));
        print(solver.getFrictionVector(given[1]));
        std::cout << '\n';
    }
}
