// See loopback.hpp.
#include "loopback.hpp"

#include <algorithm>
#include <cmath>

#include "pluginlib/class_list_macros.hpp"

extern "C" {
#include "@plant@.h"
}

namespace @package@ {

using hardware_interface::CallbackReturn;
using hardware_interface::return_type;

CallbackReturn Loopback::on_configure(const rclcpp_lifecycle::State &)
{
    for (std::size_t i = 0; i < N; i++) {
        position_[i] = std::string(JOINTS[i]) + "/position";
        velocity_[i] = std::string(JOINTS[i]) + "/velocity";
        effort_[i] = std::string(JOINTS[i]) + "/effort";
        if (!has_state(position_[i]) || !has_state(velocity_[i]) || !has_state(effort_[i]) ||
            !has_command(effort_[i])) {
            RCLCPP_ERROR(get_logger(), "joint \"%s\": the URDF lacks one of its interfaces",
                         JOINTS[i]);
            return CallbackReturn::FAILURE;
        }
    }
    return CallbackReturn::SUCCESS;
}

CallbackReturn Loopback::on_activate(const rclcpp_lifecycle::State &)
{
    q_ = Q;
    q1_ = Q1;
    acted_.fill(0.0);
    ticks_ = 0;
    failed_ = false;
    for (const auto & name : effort_) set_command(name, std::nan(""));
    return read(rclcpp::Time(), rclcpp::Duration(0, 0)) == return_type::OK ? CallbackReturn::SUCCESS
                                                                          : CallbackReturn::ERROR;
}

return_type Loopback::read(const rclcpp::Time &, const rclcpp::Duration &)
{
    double joint[N], rate[N], pose[6], pose_rate[6];
    if (failed_ || @plant@_joints(q_.data(), q1_.data(), joint, rate, pose, pose_rate) != @PLANT@_OK)
        return return_type::ERROR;
    for (std::size_t i = 0; i < N; i++) {
        set_state(position_[i], joint[i] + ZERO[i]);
        set_state(velocity_[i], rate[i]);
        set_state(effort_[i], acted_[i]);
    }
@sense@    return return_type::OK;
}

return_type Loopback::write(const rclcpp::Time &, const rclcpp::Duration &)
{
    std::array<double, N> asked;
    for (std::size_t i = 0; i < N; i++) {
        asked[i] = std::clamp(get_command(effort_[i]), LOW[i], HIGH[i]);
        if (!std::isfinite(asked[i])) return return_type::OK;
    }
    if (ticks_ == 0) asked_.fill(asked);  // drives hold the first efforts until the second come
    asked_[static_cast<std::size_t>(ticks_ % (DELAY + 1))] = asked;
    ticks_++;
    acted_ = asked_[static_cast<std::size_t>(ticks_ % (DELAY + 1))];
    failed_ = failed_ || !advance(acted_);
    return failed_ ? return_type::ERROR : return_type::OK;
}

// Runge-Kutta steps over one period.
bool Loopback::advance(const std::array<double, N> & effort)
{
    static constexpr double none[3] = {0.0, 0.0, 0.0};
@pushed@    const double h = 1.0 / (RATE * STEPS), shares[4] = {0.0, h / 2, h / 2, h};
    for (int step = 0; step < STEPS; step++) {
        std::array<double, M> q = q_, q1 = q1_, dq{}, dq1{}, rate{}, acceleration{};
        for (int k = 0; k < 4; k++) {
            for (std::size_t i = 0; i < M; i++) {
                q[i] = q_[i] + shares[k] * rate[i];
                q1[i] = q1_[i] + shares[k] * acceleration[i];
            }
            if (@plant@_forward(q.data(), q1.data(), effort.data(), none, none, none,
                                acceleration.data()@contact@) != @PLANT@_OK)
                return false;
            rate = q1;
            const double weight = k == 0 || k == 3 ? h / 6 : h / 3;
            for (std::size_t i = 0; i < M; i++) {
                dq[i] += weight * rate[i];
                dq1[i] += weight * acceleration[i];
            }
        }
        for (std::size_t i = 0; i < M; i++) {
            q_[i] += dq[i];
            q1_[i] += dq1[i];
        }
    }
    return true;
}

}  // namespace @package@

PLUGINLIB_EXPORT_CLASS(@package@::Loopback, hardware_interface::SystemInterface)
