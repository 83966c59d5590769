// Controller plugin of ros2_control around @prefix@_controller.c. Written by condyle @version@.
#pragma once

#include <array>
#include <atomic>
#include <fstream>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "controller_interface/controller_interface.hpp"
#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "numbers.hpp"
#include "rclcpp/rclcpp.hpp"
#include "std_msgs/msg/string.hpp"

extern "C" {
#include "@prefix@_controller.h"
}

namespace @package@ {

// What `update` leaves for the diagnostics, each number by itself: no lock, no allocation. Since the
// last message: the longest tick, and the least distances to limits.
struct Observed {
    std::atomic<bool> active{false};
    std::atomic<int> state{0}, why{0}, status{0}, late{0}, lost{0};
    std::atomic<unsigned> faults{0}, unconverged{0}, ticks{0}, missed{0};
    std::atomic<double> tick{0.0};  // [s]
    std::array<std::atomic<double>, N> effort, speed;  // [N m or N], [rad/s or m/s]
    static_assert(std::atomic<double>::is_always_lock_free);
};

class Controller : public controller_interface::ControllerInterface {
public:
    Controller() { forget_distances(); }
    ~Controller() override { end_log(); }
    Controller(const Controller &) = delete;
    Controller & operator=(const Controller &) = delete;
    controller_interface::CallbackReturn on_init() override;
    controller_interface::CallbackReturn on_configure(const rclcpp_lifecycle::State &) override;
    controller_interface::CallbackReturn on_activate(const rclcpp_lifecycle::State &) override;
    controller_interface::CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) override;
    controller_interface::CallbackReturn on_cleanup(const rclcpp_lifecycle::State &) override;
    controller_interface::InterfaceConfiguration command_interface_configuration() const override;
    controller_interface::InterfaceConfiguration state_interface_configuration() const override;

    // One tick: no allocation, no lock, no output. ERROR once the watchdog has stopped the machine.
    controller_interface::return_type update(const rclcpp::Time & time,
                                             const rclcpp::Duration & period) override;

    // State, estimate and memory, for tests.
    const @prefix@_controller & state() const { return controller_; }

private:
    bool read_path(const std::string & file);
    bool read(@prefix@_measured & measured);
    bool begin(const @prefix@_measured & measured);
    const @prefix@_reference & reference(double now, int & wanted);
    bool begin_log();
    void write_log();
    void end_log();
    void observe(double now, const std::array<double, @PREFIX@_JOINTS> & effort, double seconds);
    void forget_distances();
    diagnostic_msgs::msg::DiagnosticArray diagnose();

    std::vector<@prefix@_reference> path_;  // one row a period
    std::vector<@prefix@_record> log_;       // a ring, which `writer_` empties into `file_`
    std::atomic<long> logged_{0};            // records that the ring has had
    std::atomic<bool> logging_{false};
    std::ofstream file_;
    std::thread writer_;
    @prefix@_controller controller_{};
    std::atomic<int> wanted_{@PREFIX@_WANT_OFF};  // off, hold, run or stop
    std::optional<rclcpp::Time> start_;      // of the first tick
    double run_since_ = 0.0;                 // when it began to follow the path [s]
    bool at_start_ = false;                  // it is in run from the first tick on
    rclcpp::Subscription<std_msgs::msg::String>::SharedPtr wish_;
    Observed observed_;
    double last_ = 0.0;                      // time of the last tick [s]
    unsigned told_ticks_ = 0, told_missed_ = 0, told_unconverged_ = 0;  // by the last message
    rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray>::SharedPtr diagnostics_;
    rclcpp::TimerBase::SharedPtr timer_;     // of diagnostics, in the node's executor
};

}  // namespace @package@
