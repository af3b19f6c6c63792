// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/config.h>

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <visp3/core/vpException.h>
#include <yaml-cpp/yaml.h>

namespace bole
{
namespace
{
[[noreturn]] void fail(const std::string &message) { throw vpException(vpException::badValue, "%s", message.c_str()); }

const std::map<std::string, EnergyForm> kEnergyForms = {{"absolute_mean", EnergyForm::absolute_mean},
                                                        {"paper", EnergyForm::paper}};

/// What the value of an entry must be, for messages.
struct Kind
{
  std::string operator()(double *) const { return "a number"; }
  std::string operator()(int *) const { return "a whole number"; }
  std::string operator()(bool *) const { return "true or false"; }
  std::string operator()(std::vector<int> *) const { return "a list of whole numbers"; }
  std::string operator()(EnergyForm *) const { return "absolute_mean or paper"; }
  std::string operator()(LossKind *) const { return "quadratic, huber or cauchy"; }
};

/// Assigns a YAML node to an entry; false when it is not of the entry's kind.
struct Assign
{
  const YAML::Node &node;

  template <typename T> bool scalar(T *to) const { return node.IsScalar() && YAML::convert<T>::decode(node, *to); }
  bool operator()(double *to) const { return scalar(to) && std::isfinite(*to); }
  bool operator()(int *to) const { return scalar(to); }
  bool operator()(bool *to) const { return scalar(to); }
  bool operator()(std::vector<int> *to) const
  {
    return node.IsSequence() && YAML::convert<std::vector<int>>::decode(node, *to);
  }
  bool operator()(EnergyForm *to) const
  {
    const auto it = node.IsScalar() ? kEnergyForms.find(node.Scalar()) : kEnergyForms.end();
    if (it == kEnergyForms.end())
      return false;
    *to = it->second;
    return true;
  }
  bool operator()(LossKind *to) const
  {
    for (const LossKind kind : {LossKind::quadratic, LossKind::huber, LossKind::cauchy})
      if (node.IsScalar() && node.Scalar() == toString(kind)) {
        *to = kind;
        return true;
      }
    return false;
  }
};

struct Print
{
  std::string operator()(const double *value) const { return fmt::format("{}", *value); }
  std::string operator()(const int *value) const { return fmt::format("{}", *value); }
  std::string operator()(const bool *value) const { return *value ? "true" : "false"; }
  std::string operator()(const std::vector<int> *value) const { return fmt::format("[{}]", fmt::join(*value, ", ")); }
  std::string operator()(const EnergyForm *value) const
  {
    return *value == EnergyForm::paper ? "paper" : "absolute_mean";
  }
  std::string operator()(const LossKind *value) const { return toString(*value); }
};

std::string where(const std::string &path, const YAML::Mark &mark) { return fmt::format("{}:{}", path, mark.line + 1); }

void addFlow(std::vector<OptionEntry> &entries, FlowOptions &o)
{
  entries.insert(entries.end(), {{"flow.use_points", &o.use_points},
                                 {"flow.use_saliency", &o.use_saliency},
                                 {"flow.detect_lines", &o.detect_lines},
                                 {"flow.detect_window", &o.detect_window},
                                 {"flow.detect_every", &o.detect_every},
                                 {"flow.adopt_most", &o.adopt_most},
                                 {"flow.view_spacing", &o.view_spacing},
                                 {"flow.trunk_low", &o.trunk_low},
                                 {"flow.trunk_high", &o.trunk_high},
                                 {"flow.track_range", &o.track_range},
                                 {"flow.gate", &o.gate},
                                 {"flow.contrast_noise", &o.contrast_noise},
                                 {"flow.gate_sigma_px", &o.gate_sigma_px},
                                 {"flow.search_px", &o.search_px},
                                 {"flow.view_correlation", &o.view_correlation},
                                 {"flow.turned_frames", &o.turned_frames}});
}

void addMotion(std::vector<OptionEntry> &entries, MotionModelOptions &o)
{
  entries.insert(entries.end(), {{"motion.step_sigma", &o.step_sigma},
                                 {"motion.step_scale_sigma", &o.step_scale_sigma},
                                 {"motion.scale_sigma", &o.scale_sigma},
                                 {"motion.step_sigma_vertical", &o.step_sigma_vertical},
                                 {"motion.height_sigma", &o.height_sigma},
                                 {"motion.tilt_sigma", &o.tilt_sigma},
                                 {"motion.turn_sigma", &o.turn_sigma},
                                 {"motion.gyro_turn_sigma", &o.gyro_turn_sigma},
                                 {"motion.free_step_sigma", &o.free_step_sigma},
                                 {"motion.free_turn_sigma", &o.free_turn_sigma}});
}

void addVisual(std::vector<OptionEntry> &entries, VisualOdometryOptions &o)
{
  entries.insert(entries.end(), {{"visual.camera_height", &o.camera_height},
                                 {"visual.camera_height_sigma", &o.camera_height_sigma},
                                 {"visual.start_height", &o.start_height},
                                 {"visual.start_depth", &o.start_depth},
                                 {"visual.start_sigma", &o.start_sigma},
                                 {"visual.step_sigma", &o.step_sigma},
                                 {"visual.step_scale_sigma", &o.step_scale_sigma},
                                 {"visual.turn_sigma", &o.turn_sigma},
                                 {"visual.still_sigma", &o.still_sigma},
                                 {"visual.max_iterations", &o.max_iterations},
                                 {"visual.focal_known", &o.focal_known}});
}

void addPoints(std::vector<OptionEntry> &entries, PointMotionOptions &o)
{
  entries.insert(entries.end(), {{"points.max_points", &o.points.max_points},
                                 {"points.columns", &o.points.columns},
                                 {"points.rows", &o.points.rows},
                                 {"points.min_distance_px", &o.points.min_distance_px},
                                 {"points.quality", &o.points.quality},
                                 {"points.min_response", &o.points.min_response},
                                 {"points.window_px", &o.points.window_px},
                                 {"points.levels", &o.points.levels},
                                 {"points.iterations", &o.points.iterations},
                                 {"points.max_backward_px", &o.points.max_backward_px},
                                 {"points.margin_px", &o.points.margin_px},
                                 {"points.history", &o.points.history},
                                 {"points.use_gyro", &o.use_gyro},
                                 {"points.use_odometry", &o.use_odometry},
                                 {"points.frames_back", &o.frames_back},
                                 {"points.odometry_walk", &o.odometry_walk},
                                 {"points.odometry_height_sigma", &o.odometry_height_sigma},
                                 {"points.odometry_relative_sigma", &o.odometry_relative_sigma},
                                 {"gyro.noise_density", &o.gyro.noise_density},
                                 {"gyro.bias_sigma", &o.gyro.bias_sigma},
                                 {"gyro.bias_walk", &o.gyro.bias_walk},
                                 {"gyro.max_gap", &o.gyro.max_gap},
                                 {"gyro.gap_rate_sigma", &o.gyro.gap_rate_sigma},
                                 {"relative_pose.min_matches", &o.relative_pose.min_matches},
                                 {"relative_pose.min_sigma_px", &o.relative_pose.min_sigma_px},
                                 {"relative_pose.max_sigma_px", &o.relative_pose.max_sigma_px},
                                 {"relative_pose.kernel", &o.relative_pose.kernel},
                                 {"relative_pose.iterations", &o.relative_pose.iterations},
                                 {"relative_pose.hypotheses", &o.relative_pose.hypotheses},
                                 {"relative_pose.min_parallax_ratio", &o.relative_pose.min_parallax_ratio},
                                 {"relative_pose.inflation", &o.relative_pose.inflation}});
}

void addSaliency(std::vector<OptionEntry> &entries, SaliencyOptions &o)
{
  entries.insert(entries.end(), {{"saliency.sigma_intensity", &o.sigma_intensity},
                                 {"saliency.sigma_background_px", &o.sigma_background_px},
                                 {"saliency.sigma_foreground_px", &o.sigma_foreground_px},
                                 {"saliency.label_window_px", &o.label_window_px},
                                 {"saliency.background_prior", &o.background_prior},
                                 {"saliency.foreground_mean_zero", &o.foreground_mean_zero},
                                 {"saliency.linear_flow", &o.linear_flow},
                                 {"saliency.iterations", &o.iterations},
                                 {"saliency.levels", &o.levels},
                                 {"saliency.finest_level", &o.finest_level},
                                 {"saliency.use_rotation_prior", &o.use_rotation_prior},
                                 {"saliency.sigma_rotation_pull", &o.sigma_rotation_pull},
                                 {"saliency.sample_correlation", &o.sample_correlation},
                                 {"saliency.use_translation", &o.use_translation},
                                 {"saliency.sigma_residual", &o.sigma_residual},
                                 {"saliency.translation_noise_scale", &o.translation_noise_scale},
                                 {"saliency.near_range", &o.near_range},
                                 {"saliency.min_range", &o.min_range},
                                 {"saliency.inverse_depths", &o.inverse_depths},
                                 {"saliency.window_width_px", &o.window_width_px},
                                 {"saliency.window_height_px", &o.window_height_px},
                                 {"saliency.min_parallax_px", &o.min_parallax_px},
                                 {"saliency.max_frames_apart", &o.max_frames_apart},
                                 {"saliency.evidence_decay", &o.evidence_decay},
                                 {"saliency.near_prior", &o.near_prior},
                                 {"saliency.relative_evidence", &o.relative_evidence},
                                 {"saliency.evidence_scale", &o.evidence_scale},
                                 {"saliency.unknown_below", &o.unknown_below}});
}

void addDetection(std::vector<OptionEntry> &entries, DetectorOptions &o)
{
  entries.insert(entries.end(), {{"detection.elevation_low", &o.profile.range.low},
                                 {"detection.elevation_high", &o.profile.range.high},
                                 {"detection.contrast_min", &o.profile.contrast_min},
                                 {"detection.rows_min", &o.profile.rows_min},
                                 {"detection.window", &o.window},
                                 {"detection.range_min", &o.range_min},
                                 {"detection.range_max", &o.range_max},
                                 {"detection.radius_min", &o.radius_min},
                                 {"detection.radius_max", &o.radius_max},
                                 {"detection.agreement_min", &o.agreement_min},
                                 {"detection.inliers_min", &o.inliers_min},
                                 {"detection.inlier_px", &o.inlier_px},
                                 {"detection.rms_max_px", &o.rms_max_px},
                                 {"detection.parallax_min", &o.parallax_min},
                                 {"detection.range_sigma_max", &o.range_sigma_max},
                                 {"detection.views_min", &o.views_min},
                                 {"detection.near_range", &o.near_range},
                                 {"detection.foreground_min", &o.foreground_min}});
}

void addLines(std::vector<OptionEntry> &entries, LineDetectorOptions &o)
{
  entries.insert(entries.end(), {{"lines.either_polarity", &o.either_polarity},
                                 {"lines.border_a", &o.border_a},
                                 {"lines.border_b", &o.border_b},
                                 {"lines.foreground_a", &o.foreground_a},
                                 {"lines.foreground_b", &o.foreground_b},
                                 {"lines.inhibition_px", &o.inhibition_px},
                                 {"lines.threshold", &o.threshold},
                                 {"lines.turning_threshold", &o.turning_threshold},
                                 {"lines.width_min_px", &o.width_min_px},
                                 {"lines.width_max_px", &o.width_max_px}});
}

void addTracking(std::vector<OptionEntry> &entries, TrackingOptions &o)
{
  entries.insert(entries.end(), {{"energy.form", &o.energy.form},
                                 {"energy.alpha", &o.energy.alpha},
                                 {"energy.paper_alpha", &o.energy.paper_alpha},
                                 {"energy.contrast_floor", &o.energy.contrast_floor},
                                 {"energy.hessian_step_px", &o.energy.hessian_step_px},
                                 {"tracking.scan", &o.scan},
                                 {"tracking.scan_min_px", &o.scan_min_px},
                                 {"tracking.scan_max_px", &o.scan_max_px},
                                 {"tracking.scan_sigmas", &o.scan_sigmas},
                                 {"tracking.contrast_min", &o.contrast_min},
                                 {"tracking.rows_min", &o.rows_min},
                                 {"tracking.tilt_sigma", &o.tilt_sigma},
                                 {"tracking.polish_max_px", &o.polish_max_px}});
}

void addSmoothing(std::vector<OptionEntry> &entries, SmootherOptions &o)
{
  entries.insert(entries.end(), {{"smoothing.relinearise_position", &o.relinearise_position},
                                 {"smoothing.relinearise_rotation", &o.relinearise_rotation},
                                 {"smoothing.relinearise_log_radius", &o.relinearise_log_radius},
                                 {"smoothing.relinearise_lean", &o.relinearise_lean},
                                 {"smoothing.propagation_threshold", &o.propagation_threshold},
                                 {"smoothing.max_iterations", &o.max_iterations},
                                 {"smoothing.summary_loss", &o.summary_loss.kind},
                                 {"smoothing.summary_loss_width", &o.summary_loss.width},
                                 {"smoothing.direction_loss", &o.direction_loss.kind},
                                 {"smoothing.direction_loss_width", &o.direction_loss.width},
                                 {"smoothing.prior_radius", &o.prior_radius},
                                 {"smoothing.prior_log_radius_sigma", &o.prior_log_radius_sigma},
                                 {"smoothing.prior_lean_sigma", &o.prior_lean_sigma},
                                 {"smoothing.prior_position_sigma", &o.prior_position_sigma},
                                 {"smoothing.fixed_lag", &o.fixed_lag}});
}

void addMap(std::vector<OptionEntry> &entries, MapOptions &o)
{
  entries.insert(entries.end(), {{"map.confirm_observations", &o.confirm_observations},
                                 {"map.confirm_predicted", &o.confirm_predicted},
                                 {"map.confirm_parallax", &o.confirm_parallax},
                                 {"map.confirm_position_sigma", &o.confirm_position_sigma},
                                 {"map.confirm_evidence", &o.confirm_evidence},
                                 {"map.turning_evenness", &o.turning_evenness},
                                 {"map.turning_contrast", &o.turning_contrast},
                                 {"map.doubt_observations", &o.doubt_observations},
                                 {"map.doubt_candidate", &o.doubt_candidate},
                                 {"map.doubt_confirmed", &o.doubt_confirmed},
                                 {"map.doubt_rival", &o.doubt_rival},
                                 {"map.near_range", &o.near_range},
                                 {"map.through_range", &o.through_range},
                                 {"map.innovation_unit_px", &o.innovation_unit_px},
                                 {"map.usual_radius", &o.usual_radius},
                                 {"map.lost_misses", &o.lost_misses},
                                 {"map.candidate_memory_s", &o.candidate_memory_s},
                                 {"map.merge_distance", &o.merge_distance},
                                 {"map.radius_min", &o.radius_min},
                                 {"map.radius_max", &o.radius_max}});
}

std::string stageOf(const std::string &name) { return name.substr(0, name.find('.')); }

/// Assigns the pairs of one stage's map.
void readStage(const std::string &path, const std::string &stage, const YAML::Node &map,
               const std::vector<OptionEntry> &entries)
{
  if (!map.IsMap())
    fail(fmt::format("{}: {} must be a map of options", where(path, map.Mark()), stage));
  std::vector<std::string> seen;
  for (const auto &pair : map) {
    const std::string name = stage + "." + pair.first.as<std::string>();
    const auto entry =
        std::find_if(entries.begin(), entries.end(), [&](const OptionEntry &e) { return e.name == name; });
    if (entry == entries.end())
      fail(fmt::format("{}: {} is no option", where(path, pair.first.Mark()), name));
    if (std::find(seen.begin(), seen.end(), name) != seen.end())
      fail(fmt::format("{}: {} is given twice", where(path, pair.first.Mark()), name));
    seen.push_back(name);
    if (!std::visit(Assign{pair.second}, entry->value))
      fail(fmt::format("{}: {} = {}, must be {}", where(path, pair.second.Mark()), name, YAML::Dump(pair.second),
                       std::visit(Kind(), entry->value)));
  }
}

/// Line of the option that a message of validate() names, or the first line of the file.
std::string locate(const std::string &path, const YAML::Node &root, const std::string &message)
{
  for (const auto &stage : root)
    for (const auto &pair : stage.second)
      if (message.find(stage.first.as<std::string>() + "." + pair.first.as<std::string>() + " =") != std::string::npos)
        return where(path, pair.first.Mark());
  return path;
}
} // namespace

std::vector<OptionEntry> optionEntries(StageOptions &options)
{
  std::vector<OptionEntry> entries;
  addFlow(entries, options.flow);
  addMotion(entries, options.motion);
  addVisual(entries, options.visual);
  addPoints(entries, options.points);
  entries.insert(entries.end(), {{"gradient.sigma_px", &options.gradient.sigma_px},
                                 {"gradient.split", &options.gradient.split},
                                 {"gradient.split_sigma_px", &options.gradient.split_sigma_px}});
  addSaliency(entries, options.saliency);
  addDetection(entries, options.detection);
  addLines(entries, options.lines);
  addTracking(entries, options.tracking);
  addSmoothing(entries, options.smoothing);
  addMap(entries, options.map);
  return entries;
}

void readConfig(const std::string &path, StageOptions &options)
{
  YAML::Node root;
  try {
    root = YAML::LoadFile(path);
  }
  catch (const YAML::BadFile &) {
    fail(fmt::format("{}: cannot be opened", path));
  }
  catch (const YAML::Exception &error) {
    fail(fmt::format("{}: {}", where(path, error.mark), error.msg));
  }
  StageOptions changed = options;
  const auto entries = optionEntries(changed);
  if (!root.IsNull() && !root.IsMap())
    fail(fmt::format("{}: must be a map of stages", path));
  std::vector<std::string> seen;
  for (const auto &pair : root) {
    const std::string stage = pair.first.as<std::string>();
    if (std::none_of(entries.begin(), entries.end(), [&](const OptionEntry &e) { return stageOf(e.name) == stage; }))
      fail(fmt::format("{}: {} is no stage", where(path, pair.first.Mark()), stage));
    if (std::find(seen.begin(), seen.end(), stage) != seen.end())
      fail(fmt::format("{}: {} is given twice", where(path, pair.first.Mark()), stage));
    seen.push_back(stage);
    readStage(path, stage, pair.second, entries);
  }
  try {
    changed.validate();
  }
  catch (const vpException &error) {
    fail(fmt::format("{}: {}", locate(path, root, error.getStringMessage()), error.getStringMessage()));
  }
  options = changed;
}

void setOption(const std::string &assignment, StageOptions &options)
{
  const auto equals = assignment.find('=');
  const std::string name = assignment.substr(0, equals);
  StageOptions changed = options;
  for (const OptionEntry &entry : optionEntries(changed)) {
    if (entry.name != name)
      continue;
    YAML::Node node;
    if (equals != std::string::npos)
      node = YAML::Load(assignment.substr(equals + 1));
    if (!std::visit(Assign{node}, entry.value))
      fail(fmt::format("--set {}: must be {}", assignment, std::visit(Kind(), entry.value)));
    changed.validate();
    options = changed;
    return;
  }
  fail(fmt::format("--set {}: {} is no option", assignment, name));
}

std::string toYaml(const StageOptions &options)
{
  StageOptions copy = options;
  std::string text, stage;
  for (const OptionEntry &entry : optionEntries(copy)) {
    if (stageOf(entry.name) != stage) {
      stage = stageOf(entry.name);
      text += stage + ":\n";
    }
    text += fmt::format("  {}: {}\n", entry.name.substr(stage.size() + 1), std::visit(Print(), entry.value));
  }
  return text;
}
} // namespace bole
