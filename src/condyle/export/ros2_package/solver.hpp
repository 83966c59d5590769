// Plugin of the package inverse_dynamics_solver, for the whole mechanism. Written by condyle @version@.
#pragma once

#include <array>
#include <string>

#include "inverse_dynamics_solver/inverse_dynamics_solver.h"
#include "numbers.hpp"

namespace @package@ {

// Joints are those of JOINTS, as their encoders read. They are more than the freedoms: positions,
// velocities and accelerations are taken as the closest that the mechanism permits, and torques are
// of least norm. Throws std::runtime_error out of reach, std::invalid_argument for a wrong size.
class Solver : public inverse_dynamics_solver::InverseDynamicsSolver {
public:
    void initialize(rclcpp::node_interfaces::NodeParametersInterface::ConstSharedPtr parameters = nullptr,
                    const std::string & name_space = "",
                    const std::string & robot_description = "") override;
    Eigen::MatrixXd getInertiaMatrix(const Eigen::VectorXd & positions) const override;
    Eigen::VectorXd getCoriolisVector(const Eigen::VectorXd & positions,
                                      const Eigen::VectorXd & velocities) const override;
    Eigen::VectorXd getGravityVector(const Eigen::VectorXd & positions) const override;
    Eigen::VectorXd getFrictionVector(const Eigen::VectorXd & velocities) const override;
    Eigen::VectorXd getTorques(const Eigen::VectorXd & positions, const Eigen::VectorXd & velocities,
                               const Eigen::VectorXd & accelerations) const override;
};

}  // namespace @package@
