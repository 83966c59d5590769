// See controller.hpp.
#include "controller.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iomanip>
#include <locale>
#include <sstream>

#include "pluginlib/class_list_macros.hpp"

namespace @package@ {

using controller_interface::CallbackReturn;
using controller_interface::InterfaceConfiguration;
using controller_interface::interface_configuration_type;
using controller_interface::return_type;

namespace {

// The state that is wanted, by its name.
std::optional<int> state_of(const std::string & name)
{
    if (name == "off") return @PREFIX@_WANT_OFF;
    if (name == "hold") return @PREFIX@_WANT_HOLD;
    if (name == "run") return @PREFIX@_WANT_RUN;
    if (name == "stop") return @PREFIX@_WANT_STOP;
    return std::nullopt;
}

void lower(std::atomic<double> & least, double x)
{
    double was = least.load();
    while (x < was && !least.compare_exchange_weak(was, x)) {}
}

std::string text_of(double x)
{
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text << std::setprecision(9) << x;
    return text.str();
}

}  // namespace

CallbackReturn Controller::on_init()
{
    auto_declare<std::string>("path", "");
    auto_declare<std::string>("wanted", "hold");
    auto_declare<bool>("at_start", false);
    auto_declare<std::string>("log_file", "");
    auto_declare<int>("log_rows", 10000);
    return CallbackReturn::SUCCESS;
}

CallbackReturn Controller::on_configure(const rclcpp_lifecycle::State &)
{
    const auto node = get_node();
    const auto logger = node->get_logger();
    if (get_update_rate() != RATE) {
        RCLCPP_ERROR(logger, "the controller was designed for %u Hz, and is updated at %u Hz",
                     RATE, get_update_rate());
        return CallbackReturn::FAILURE;
    }
    const auto wanted = state_of(node->get_parameter("wanted").as_string());
    const auto rows = node->get_parameter("log_rows").as_int();
    const bool logs = !node->get_parameter("log_file").as_string().empty();
    if (!wanted || rows < (logs ? RATE : 0) || rows > 100000000) {
        RCLCPP_ERROR(logger, "wanted is off, hold, run or stop; log_rows is 0 to 1e8, with log_file "
                     "%u, a second, or more", RATE);
        return CallbackReturn::FAILURE;
    }
    wanted_ = *wanted;
    at_start_ = node->get_parameter("at_start").as_bool();
    log_.assign(static_cast<std::size_t>(rows), @prefix@_record{});
    if (!read_path(node->get_parameter("path").as_string())) return CallbackReturn::FAILURE;
    wish_ = node->create_subscription<std_msgs::msg::String>(
        "~/wanted", rclcpp::SystemDefaultsQoS(), [this](const std_msgs::msg::String & message) {
            if (const auto state = state_of(message.data)) wanted_ = *state;
        });
    // No publisher of the lifecycle: what stopped the controller is said after it was deactivated.
    auto topics = node->get_node_topics_interface();
    diagnostics_ = rclcpp::create_publisher<diagnostic_msgs::msg::DiagnosticArray>(
        topics, "/diagnostics", 1);
    timer_ = node->create_wall_timer(std::chrono::seconds(1), [this, to = diagnostics_]() {
        to->publish(diagnose());
    });
    return CallbackReturn::SUCCESS;
}

CallbackReturn Controller::on_activate(const rclcpp_lifecycle::State &)
{
    start_.reset();
    observed_.active = true;
    return begin_log() ? CallbackReturn::SUCCESS : CallbackReturn::FAILURE;
}

CallbackReturn Controller::on_deactivate(const rclcpp_lifecycle::State &)
{
    observed_.active = false;
    bool written = true;
    for (auto & effort : command_interfaces_) written = effort.set_value(0.0) && written;
    end_log();
    return written ? CallbackReturn::SUCCESS : CallbackReturn::ERROR;
}

CallbackReturn Controller::on_cleanup(const rclcpp_lifecycle::State &)
{
    wish_.reset();
    timer_.reset();
    diagnostics_.reset();
    end_log();
    if (file_) return CallbackReturn::SUCCESS;
    RCLCPP_ERROR(get_node()->get_logger(), "the log cannot be written");
    return CallbackReturn::FAILURE;
}

InterfaceConfiguration Controller::command_interface_configuration() const
{
    InterfaceConfiguration found{interface_configuration_type::INDIVIDUAL, {}};
    for (const auto * joint : JOINTS) found.names.push_back(std::string(joint) + "/effort");
    return found;
}

InterfaceConfiguration Controller::state_interface_configuration() const
{
    InterfaceConfiguration found{interface_configuration_type::INDIVIDUAL, {}};
    for (const auto * name : MEASURED) found.names.emplace_back(name);
    return found;
}

return_type Controller::update(const rclcpp::Time & time, const rclcpp::Duration &)
{
    const auto began = std::chrono::steady_clock::now();
    @prefix@_measured measured{};
    const bool whole = read(measured);
    if (!start_) {
        if (!whole) return return_type::OK;  // the drives have not reported yet
        if (!begin(measured)) return return_type::ERROR;
        start_ = time;
        last_ = 0.0;
    }
    const double now = (time - *start_).seconds();
    int wanted = wanted_;
    const @prefix@_reference & to = reference(now, wanted);
    std::array<double, @PREFIX@_JOINTS> effort;
    const int before = controller_.state;
    const int state = @prefix@_step(&controller_, now, &measured, wanted, &to, effort.data());
    logged_.store(controller_.logged, std::memory_order_release);
    if (state == @PREFIX@_RUN && before != state) run_since_ = now;
    bool written = true;
    for (std::size_t i = 0; i < effort.size(); i++)
        written = command_interfaces_[i].set_value(effort[i]) && written;
    const std::chrono::duration<double> lasted = std::chrono::steady_clock::now() - began;
    observe(now, effort, lasted.count());
    const bool stopped = state == @PREFIX@_OFF && controller_.why != @PREFIX@_FINE;
    return written && !stopped ? return_type::OK : return_type::ERROR;
}

// Leaves what the diagnostics tell. A tick is missed where the time since the last one is a period more.
void Controller::observe(double now, const std::array<double, @PREFIX@_JOINTS> & effort,
                         double seconds)
{
    const auto & c = controller_;
    auto & to = observed_;
    to.state = c.state;
    to.why = c.why;
    to.status = c.status;
    to.late = c.late;
    to.lost = c.lost;
    to.faults = c.faults;
    to.unconverged = c.unconverged;
    const double periods = (now - last_) * RATE;
    if (periods > 1.5 && periods < 1e6) to.missed += static_cast<unsigned>(std::lround(periods)) - 1;
    last_ = now;
    for (std::size_t i = 0; i < N; i++) {
        lower(to.effort[i], std::min(HIGH[i] - effort[i], effort[i] - LOW[i]));
        lower(to.speed[i], c.settings.speed[i] - std::abs(c.rate_kept[i]));
    }
    double longest = to.tick.load();
    while (seconds > longest && !to.tick.compare_exchange_weak(longest, seconds)) {}
    to.ticks++;
}

void Controller::forget_distances()
{
    for (auto * kind : {&observed_.effort, &observed_.speed})
        for (auto & least : *kind) least = HUGE_VAL;
}

// The message of a second, in the thread of the timer.
diagnostic_msgs::msg::DiagnosticArray Controller::diagnose()
{
    using Status = diagnostic_msgs::msg::DiagnosticStatus;
    auto & from = observed_;
    const auto node = get_node();
    const auto why = static_cast<std::size_t>(from.why.load());
    const char * state = STATES[static_cast<std::size_t>(from.state.load())];
    const unsigned ticks = from.ticks, missed = from.missed, unconverged = from.unconverged;
    const unsigned faults = from.faults;
    Status found;
    found.name = std::string(node->get_name()) + ": controller";
    found.hardware_id = "@package@";
    const auto add = [&found](const std::string & key, const std::string & value) {
        diagnostic_msgs::msg::KeyValue one;
        one.key = key;
        one.value = value;
        found.values.push_back(one);
    };
    std::string named;
    for (std::size_t i = 1; i < CAUSES.size(); i++)
        if (faults >> i & 1u) named += (named.empty() ? "" : "; ") + std::string(CAUSES[i]);
    add("active", from.active ? "true" : "false");
    add("state", state);
    add("faults since acknowledged", named.empty() ? "none" : named);
    add("status of the last tick", STATUSES[static_cast<std::size_t>(from.status.load())]);
    add("ticks", std::to_string(ticks));
    add("missed ticks", std::to_string(missed));
    add("late ticks", std::to_string(from.late));
    add("ticks with lost readings", std::to_string(from.lost));
    add("ticks without converged efforts", std::to_string(unconverged));
    add("longest tick [s]", text_of(from.tick.exchange(0.0)));
    add("period [s]", text_of(1.0 / RATE));
    for (std::size_t i = 0; i < N; i++)
        add(std::string("least distance to effort limit, ") + JOINTS[i],
            text_of(from.effort[i].exchange(HUGE_VAL)));
    for (std::size_t i = 0; i < N; i++)
        add(std::string("least distance to speed that stops, ") + JOINTS[i],
            text_of(from.speed[i].exchange(HUGE_VAL)));
    found.level = Status::OK;
    found.message = state;
    if (why != 0) {
        found.level = Status::ERROR;
        found.message = CAUSES[why];
    } else if (from.active && ticks == told_ticks_) {
        found.level = Status::STALE;
        found.message = "no tick since the last message";
    } else if (missed != told_missed_ || from.late || from.lost || unconverged != told_unconverged_) {
        found.level = Status::WARN;
        found.message = "ticks are missed or late, lack readings, or do not converge";
    }
    told_ticks_ = ticks;
    told_missed_ = missed;
    told_unconverged_ = unconverged;
    diagnostic_msgs::msg::DiagnosticArray message;
    message.header.stamp = node->now();
    message.status.push_back(found);
    return message;
}

// The readings; whether each is a number. The others are marked as lost.
bool Controller::read(@prefix@_measured & m)
{
    bool whole = true;
    std::size_t next = 0;
    const auto value = [&]() {
        const double found = state_interfaces_[next++].get_optional().value_or(std::nan(""));
        whole = whole && std::isfinite(found);
        return found;
    };
@read@    return whole;
}

// Begins off at the scenario's start; in run only if the machine is there.
bool Controller::begin(const @prefix@_measured & measured)
{
    int state = @PREFIX@_OFF;
    if (at_start_) {
        for (std::size_t i = 0; i < START.size(); i++)
            if (!(std::abs(measured.joint[i] - START[i]) < START_TOLERANCE)) return false;
        state = @PREFIX@_RUN;
    }
    run_since_ = 0.0;
    return @prefix@_begin(&controller_, &@PREFIX@_SETTINGS, Q.data(), Q1.data(), &measured, state,
                          log_.empty() ? nullptr : log_.data(),
                          static_cast<int>(log_.size())) == @PREFIX@_OK;
}

// What it is to follow: the row of the path nearest in time, so that jitter changes nothing. At the
// path's end it holds; until it runs, the path waits at its first row.
const @prefix@_reference & Controller::reference(double now, int & wanted)
{
    if (controller_.state != @PREFIX@_RUN) return path_.front();
    const auto row = static_cast<std::size_t>(std::max(0L, std::lround((now - run_since_) * RATE)));
    if (row < path_.size()) return path_[row];
    int run = @PREFIX@_WANT_RUN;
    if (wanted_.compare_exchange_strong(run, @PREFIX@_WANT_HOLD))
        wanted = @PREFIX@_WANT_HOLD;
    return path_.back();
}

// Rows of t, q, q', q'' and the force, one a period.
bool Controller::read_path(const std::string & file)
{
    const auto logger = get_node()->get_logger();
    std::ifstream from(file);
    std::string line;
    std::array<double, 3 * @PREFIX@_FREE + 2> row;
    path_.clear();
    if (!std::getline(from, line) || line.substr(0, line.find('\r')) != COLUMNS) {
        RCLCPP_ERROR(logger, "path \"%s\": expected a file with the columns %s", file.c_str(), COLUMNS);
        return false;
    }
    while (std::getline(from, line)) {
        std::istringstream cells(line);
        cells.imbue(std::locale::classic());
        char comma = ',';
        bool right = true;
        for (auto & cell : row) {
            right = right && comma == ',' && (cells >> cell);
            comma = '\0';
            cells >> comma;
        }
        const double *q = &row[1], *q1 = q + @PREFIX@_FREE, *q2 = q1 + @PREFIX@_FREE;
        path_.emplace_back();
        right = right && comma == '\0' &&
                std::abs(row[0] * RATE - static_cast<double>(path_.size() - 1)) < 1e-3;
        if (!right || @prefix@_reference_at(q, q1, q2, row.back(), &path_.back()) != @PREFIX@_OK) {
            RCLCPP_ERROR(logger, "path \"%s\", row %zu: no row a period, or out of reach",
                         file.c_str(), path_.size());
            path_.clear();
            return false;
        }
    }
    return !path_.empty();
}

// Opens the log, of this activation alone, and starts the thread that writes it.
bool Controller::begin_log()
{
    const auto name = get_node()->get_parameter("log_file").as_string();
    end_log();
    if (name.empty()) return true;
    file_ = std::ofstream(name);
    file_.imbue(std::locale::classic());
    file_ << LOG_COLUMNS << '\n' << std::setprecision(17);
    if (!file_.flush()) {
        RCLCPP_ERROR(get_node()->get_logger(), "%s: cannot be written", name.c_str());
        return false;
    }
    logged_ = 0;
    logging_ = true;
    writer_ = std::thread(&Controller::write_log, this);
    return true;
}

// What `condyle identify` reads: t, joints and efforts. Ten times a second, so that a process that is
// killed loses no more. Of rows that it comes too late for, the older half of the ring is left out.
void Controller::write_log()
{
    const long rows = static_cast<long>(log_.size());
    for (long next = 0, last = 0; !last;) {
        last = !logging_;
        const long made = logged_.load(std::memory_order_acquire);
        if (made - next > rows / 2) next = made - rows / 2;
        for (; next < made; next++) {
            const auto & row = log_[static_cast<std::size_t>(next % rows)];
            file_ << row.t;
            for (const double joint : row.joint) file_ << ',' << joint;
            for (const double effort : row.effort) file_ << ',' << effort;
            file_ << '\n';
        }
        file_.flush();
        if (!last) std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
}

// Writes what is left, and ends the thread.
void Controller::end_log()
{
    logging_ = false;
    if (writer_.joinable()) writer_.join();
}

}  // namespace @package@

PLUGINLIB_EXPORT_CLASS(@package@::Controller, controller_interface::ControllerInterface)
