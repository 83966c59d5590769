// Drives an exported package as the controller manager would, and counts allocations of `update`.
//
//   drive feed PATH TICKS  measurements on stdin, a row a tick: efforts, q, q', memory, allocations
//   drive loop PATH TICKS  with the simulated hardware: efforts, joint positions, state
//   drive home PATH TICKS  the same from off, by homing
//   drive kill PATH TICKS  the same, killed once the log has as many rows
//   drive lost PATH TICKS  as loop, the machine held, an encoder silent from tick 20 on
//   drive tell PATH TICKS  as loop: efforts, speeds, allocations; then the diagnostics of that time, of
//                          no time, of a gap of two periods, of lost encoders that stop it, and after
//   drive fall PATH TICKS  the simulated hardware under efforts of 0, then of TICKS N m: positions
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <sstream>
#include <thread>

#include "controller.hpp"
#include "loopback.hpp"

static thread_local long allocations = 0;  // of the thread that ticks
extern "C" void * __libc_malloc(std::size_t);
extern "C" void * __libc_calloc(std::size_t, std::size_t);
extern "C" void * __libc_realloc(void *, std::size_t);
extern "C" void * malloc(std::size_t n) { return allocations++, __libc_malloc(n); }
extern "C" void * calloc(std::size_t n, std::size_t m) { return allocations++, __libc_calloc(n, m); }
extern "C" void * realloc(void * p, std::size_t n) { return allocations++, __libc_realloc(p, n); }

using namespace PACKAGE;
using hardware_interface::Handle;
using Done = controller_interface::CallbackReturn;

static void require(bool right, const char * what)
{
    if (right) return;
    std::cerr << what << '\n';
    std::exit(1);
}

template <typename Values>
static void print(const Values & values)
{
    for (const double x : values) std::cout << x << ' ';
}

// The law's memory, where it has one.
template <typename C>
static auto print_memory(const C & c, int) -> decltype(print(c.memory_before))
{
    print(c.memory_before);
}
template <typename C>
static void print_memory(const C &, long)
{
}

// The message that the timer publishes: level, message, then its values, a line each.
static void tell(Controller & controller)
{
    const auto node = controller.get_node();
    require(node->period == 1.0, "diagnostics come once a second");
    const auto timer = node->timer.lock();
    require(timer != nullptr, "no timer");
    timer->callback();
    const auto & found = node->get_node_topics_interface()->publishers.at("/diagnostics");
    const auto & sent =
        std::static_pointer_cast<rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray>>(found)->sent;
    require(sent.header.stamp.sec == 1 && sent.header.stamp.nanosec == 500000000u, "stamp");
    require(sent.status.size() == 1, "one status");
    const auto & one = sent.status[0];
    std::cout << "level=" << static_cast<int>(one.level) << "\nname=" << one.name
              << "\nhardware_id=" << one.hardware_id << "\nmessage=" << one.message << '\n';
    for (const auto & pair : one.values) std::cout << pair.key << '=' << pair.value << '\n';
}

int main(int count, char ** words)
{
    require(count == 4, "drive MODE PATH TICKS");
    const std::string mode = words[1];
    const long ticks = std::atol(words[3]);
    const rclcpp_lifecycle::State state;
    Controller controller;
    Loopback hardware;

    require(controller.on_init() == Done::SUCCESS, "on_init");
    auto & given = controller.get_node()->parameters;
    given["path"] = rclcpp::Parameter(std::string(words[2]));
    given["wanted"] = rclcpp::Parameter(std::string("run"));
    given["at_start"] = rclcpp::Parameter(mode != "home");
    given["log_file"] = rclcpp::Parameter(std::string("log.csv"));
    controller.update_rate = RATE + 1;
    require(controller.on_configure(state) == Done::FAILURE, "another rate is taken");
    controller.update_rate = RATE;
    require(controller.on_configure(state) == Done::SUCCESS, "on_configure");

    std::vector<hardware_interface::LoanedStateInterface> states;
    std::vector<hardware_interface::LoanedCommandInterface> commands;
    std::vector<Handle::SharedPtr> sensed;
    const auto handle = [](std::map<std::string, Handle::SharedPtr> & all, const std::string & name) {
        return all.try_emplace(name, std::make_shared<Handle>(name)).first->second;
    };
    for (const auto * joint : JOINTS)
        for (const auto * kind : {"/position", "/velocity", "/effort"})
            handle(hardware.states, std::string(joint) + kind);
    for (const auto & name : controller.state_interface_configuration().names) {
        sensed.push_back(handle(hardware.states, name));
        states.emplace_back(sensed.back());
    }
    require(hardware.on_configure(state) == Done::FAILURE, "no commands, and it is configured");
    for (const auto & name : controller.command_interface_configuration().names)
        commands.emplace_back(handle(hardware.commands, name));
    controller.assign_interfaces(std::move(commands), std::move(states));
    require(hardware.on_configure(state) == Done::SUCCESS, "hardware.on_configure");
    require(hardware.on_activate(state) == Done::SUCCESS, "hardware.on_activate");
    require(controller.on_activate(state) == Done::SUCCESS, "on_activate");

    std::cout << std::setprecision(17);
    std::vector<double> efforts(N);
    if (mode == "tell") {
        const auto period = rclcpp::Duration::from_nanoseconds(1000000000LL / RATE);
        long k = 0;
        const auto tick = [&](bool lost) {
            require(hardware.read(rclcpp::Time(), period) == hardware_interface::return_type::OK, "read");
            for (auto & one : sensed)
                if (lost) require(one->set_value(std::nan("")), "set_value");
            const long before = allocations;
            const auto done = controller.update(rclcpp::Time(k++ * (1000000000LL / RATE)), period);
            return std::make_pair(done == controller_interface::return_type::OK, allocations - before);
        };
        while (k < ticks) {
            const auto [right, made] = tick(false);
            require(right, "update");
            for (const auto * joint : JOINTS)
                std::cout << *hardware.commands.at(std::string(joint) + "/effort")->get_optional() << ' ';
            for (const auto * joint : JOINTS)
                std::cout << *hardware.states.at(std::string(joint) + "/velocity")->get_optional() << ' ';
            std::cout << made << '\n';
            require(hardware.write(rclcpp::Time(), period) == hardware_interface::return_type::OK, "write");
        }
        tell(controller);
        tell(controller);
        k += 2;
        require(tick(false).first, "update");
        tell(controller);
        while (tick(true).first) {}
        tell(controller);
        require(controller.on_deactivate(state) == Done::SUCCESS, "on_deactivate");
        tell(controller);
        require(controller.on_cleanup(state) == Done::SUCCESS, "on_cleanup");
        require(controller.get_node()->timer.expired(), "the timer is left");
        return 0;
    }
    const auto & first = hardware.states.at(std::string(JOINTS[0]) + "/position");
    if (mode == "fall") {
        const rclcpp::Time now;
        const rclcpp::Duration period(0, 1);
        auto done = hardware.write(now, period);  // no effort is commanded yet
        for (long k = 0; k < 10000 && done == hardware_interface::return_type::OK; k++) {
            std::cout << *first->get_optional() << '\n';
            for (const auto & [name, command] : hardware.commands)
                require(command->set_value(k < 10 ? 0.0 : static_cast<double>(ticks)), "set_value");
            done = hardware.write(now, period);
            if (done == hardware_interface::return_type::OK) done = hardware.read(now, period);
        }
        require(hardware.read(now, period) == hardware_interface::return_type::ERROR, "no error");
        return 0;
    }
    for (long k = 0; k < ticks; k++) {
        const rclcpp::Time now(1700000000LL * 1000000000LL + k * (1000000000LL / RATE));
        const auto period = rclcpp::Duration::from_nanoseconds(1000000000LL / RATE);
        if (mode == "feed") {
            for (auto & one : sensed) {
                double x;
                require(static_cast<bool>(std::cin >> x) && one->set_value(x), "stdin");
            }
        } else {
            require(hardware.read(now, period) == hardware_interface::return_type::OK, "read");
        }
        if (mode == "lost" && k >= 20) require(first->set_value(std::nan("")), "set_value");
        const long before = allocations;
        const auto done = controller.update(now, period);
        const long made = allocations - before;
        const bool stopped = done != controller_interface::return_type::OK;
        require(mode == "lost" || !stopped, "update");
        if (stopped) break;
        std::size_t i = 0;
        for (const auto * joint : JOINTS)
            efforts[i++] =
                hardware.commands.at(std::string(joint) + "/effort")->get_optional().value();
        print(efforts);
        if (mode == "feed") {
            print(controller.state().q);
            print(controller.state().q1);
            print_memory(controller.state(), 0);
            std::cout << made << '\n';
        } else {
            for (const auto * joint : JOINTS)
                std::cout << *hardware.states.at(std::string(joint) + "/position")->get_optional()
                          << ' ';
            std::cout << controller.state().state << '\n';
            if (mode == "lost") continue;  // the machine is held
            require(hardware.write(now, period) == hardware_interface::return_type::OK, "write");
        }
    }
    std::cout.flush();
    while (mode == "kill") {
        std::ifstream log("log.csv");
        long rows = 0;
        for (std::string line; std::getline(log, line);) rows++;
        if (rows > ticks) std::raise(SIGKILL);
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    require(controller.on_deactivate(state) == Done::SUCCESS, "on_deactivate");
    for (const auto & [name, command] : hardware.commands)
        require(*command->get_optional() == 0.0, "an effort is left");
    require(controller.on_cleanup(state) == Done::SUCCESS, "on_cleanup");
    return 0;
}
