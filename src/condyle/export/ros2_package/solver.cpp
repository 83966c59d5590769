// See solver.hpp.
#include "solver.hpp"

#include <cmath>
#include <stdexcept>

#include "pluginlib/class_list_macros.hpp"

extern "C" {
#include "@solver@.h"
}

namespace @package@ {

namespace {

using Joints = std::array<double, N>;
constexpr int PARTS = 8, TURNS = 6;  // of three Newton steps each

void require(int status)
{
    if (status != @SOLVER@_OK)
        throw std::runtime_error("@package@: no solution there, status " + std::to_string(status) +
                                 " of @solver@.h");
}

Joints joints_of(const Eigen::VectorXd & given)
{
    Joints found;
    if (given.size() != static_cast<Eigen::Index>(N))
        throw std::invalid_argument("@package@: expected " + std::to_string(N) + " joints, got " +
                                    std::to_string(given.size()));
    for (std::size_t i = 0; i < N; i++) found[i] = given(static_cast<Eigen::Index>(i));
    return found;
}

Eigen::VectorXd vector_of(const Joints & values)
{
    Eigen::VectorXd found(static_cast<Eigen::Index>(N));
    for (std::size_t i = 0; i < N; i++) found(static_cast<Eigen::Index>(i)) = values[i];
    return found;
}

// The mechanism at joint positions and velocities.
struct State {
    Joints joint;
    std::array<double, M> q{}, q1{};
    std::array<double, 6> pose{};

    // From home to the positions in parts, for each begins where Newton's steps lead on.
    State(const Joints & position, const Joints & velocity) : joint(position)
    {
        double rate[6], moved = 1.0;
        for (int k = 1; k <= PARTS + TURNS && moved > 1e-13; k++) {
            const auto before = pose;
            Joints part = joint;
            for (std::size_t i = 0; i < N && k < PARTS; i++)
                part[i] = ZERO[i] + (joint[i] - ZERO[i]) * k / PARTS;
            require(@solver@_state(part.data(), velocity.data(), before.data(), q.data(), q1.data(),
                                   pose.data(), rate));
            moved = k < PARTS ? 1.0 : 0.0;
            for (std::size_t i = 0; i < 6; i++) moved = std::fmax(moved, std::abs(pose[i] - before[i]));
        }
        if (!(moved < 1e-9)) throw std::runtime_error("@package@: no pose has these joint positions");
    }

    // Torques at joint accelerations; without motion they are those of gravity.
    Joints torques(const Joints & acceleration) const
    {
        std::array<double, M> none{}, q_again, q2;
        Joints d_joint, moved = {}, torque;
        double d_pose[6], d_pose_rate[6], rate[6];
        std::array<double, 6> again;
        const double load[3] = {0.0, 0.0, 0.0};
        // joint'' = J q'' + J' q'; the second term is the derivative of joint' along q'.
        require(@solver@_joints_derivative(q.data(), q1.data(), q1.data(), none.data(),
                                           d_joint.data(), moved.data(), d_pose, d_pose_rate));
        for (std::size_t i = 0; i < N; i++) moved[i] = acceleration[i] - moved[i];
        require(@solver@_state(joint.data(), moved.data(), pose.data(), q_again.data(), q2.data(),
                               again.data(), rate));
        require(@solver@_inverse(q.data(), q1.data(), q2.data(), load, load, load, torque.data()));
        return torque;
    }
};

}  // namespace

void Solver::initialize(rclcpp::node_interfaces::NodeParametersInterface::ConstSharedPtr,
                        const std::string &, const std::string &)
{
}  // all numbers are compiled in

Eigen::VectorXd Solver::getTorques(const Eigen::VectorXd & positions,
                                   const Eigen::VectorXd & velocities,
                                   const Eigen::VectorXd & accelerations) const
{
    const State state(joints_of(positions), joints_of(velocities));
    return vector_of(state.torques(joints_of(accelerations)));
}

Eigen::VectorXd Solver::getGravityVector(const Eigen::VectorXd & positions) const
{
    return vector_of(State(joints_of(positions), {}).torques({}));
}

Eigen::VectorXd Solver::getCoriolisVector(const Eigen::VectorXd & positions,
                                          const Eigen::VectorXd & velocities) const
{
    Joints moving = State(joints_of(positions), joints_of(velocities)).torques({});
    const Joints still = State(joints_of(positions), {}).torques({});
    for (std::size_t i = 0; i < N; i++) moving[i] -= still[i];
    return vector_of(moving);
}

Eigen::MatrixXd Solver::getInertiaMatrix(const Eigen::VectorXd & positions) const
{
    const State state(joints_of(positions), {});
    const Joints still = state.torques({});
    Eigen::MatrixXd found(static_cast<Eigen::Index>(N), static_cast<Eigen::Index>(N));
    for (std::size_t j = 0; j < N; j++) {
        Joints one{};
        one[j] = 1.0;
        const Joints torque = state.torques(one);
        for (std::size_t i = 0; i < N; i++)
            found(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = torque[i] - still[i];
    }
    return found;
}

Eigen::VectorXd Solver::getFrictionVector(const Eigen::VectorXd & velocities) const
{
    Joints found = joints_of(velocities);
    for (std::size_t i = 0; i < N; i++) {
        const double v = found[i];
        found[i] = VISCOUS[i] * v + COULOMB[i] * v / std::hypot(v, SMOOTHING_SPEED[i]);
    }
    return vector_of(found);
}

}  // namespace @package@

PLUGINLIB_EXPORT_CLASS(@package@::Solver, inverse_dynamics_solver::InverseDynamicsSolver)
