#include "tools/evaluation/charts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>

#include "core/error.hpp"
#include "sink/sink.hpp"

namespace cosegraph::evaluation {
namespace {

// Lengths are in pixels.
constexpr int kMaxWidth = 2200;
constexpr int kMargin = 24;

const cv::Scalar kInk(40, 40, 40);
const cv::Scalar kFaintInk(110, 110, 110);
const cv::Scalar kGrid(228, 228, 228);
const cv::Scalar kFaintGrid(243, 243, 243);
const cv::Scalar kPaper(255, 255, 255);

// ---- text

struct Font {
  int face;
  double size;
  cv::Scalar ink;
  int line;  // from one base line to the next
};
const Font kTitleFont{cv::FONT_HERSHEY_DUPLEX, 0.7, kInk, 30};
const Font kSubtitleFont{cv::FONT_HERSHEY_SIMPLEX, 0.48, kFaintInk, 21};
const Font kGroupFont{cv::FONT_HERSHEY_SIMPLEX, 0.52, kInk, 24};
const Font kLegendFont{cv::FONT_HERSHEY_SIMPLEX, 0.5, kInk, 26};
const Font kTickFont{cv::FONT_HERSHEY_SIMPLEX, 0.45, kFaintInk, 20};
const Font kValueFont{cv::FONT_HERSHEY_SIMPLEX, 0.4, kInk, 16};

// Width, and height of its capitals.
cv::Size text_size(const std::string& text, const Font& font) {
  int baseline = 0;
  return cv::getTextSize(text, font.face, font.size, 1, &baseline);
}

int text_width(const std::string& text, const Font& font) {
  return text_size(text, font).width;
}

int widest(const std::vector<std::string>& texts, const Font& font) {
  int result = 0;
  for (const auto& text : texts) result = std::max(result, text_width(text, font));
  return result;
}

std::string shortened(const std::string& text, const Font& font, int width) {
  if (text_width(text, font) <= width) return text;
  std::string start = text;
  do start.pop_back();
  while (!start.empty() && text_width(start + "...", font) > width);
  return start + "...";
}

std::vector<std::string> shortened(std::vector<std::string> texts, const Font& font, int width) {
  for (auto& text : texts) text = shortened(text, font, width);
  return texts;
}

// Broken between words into lines of at most `width`; none for an empty text.
std::vector<std::string> wrapped(const std::string& text, const Font& font, int width) {
  std::vector<std::string> lines;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    const std::string word = text.substr(at, end - at);
    if (!lines.empty() && text_width(lines.back() + " " + word, font) <= width)
      lines.back() += " " + word;
    else
      lines.push_back(word);
    at = end + 1;
  }
  return shortened(std::move(lines), font, width);
}

// Lays `ink` over the image where `mask` (0 .. 255) says so, its top left corner at `corner`.
void blend(cv::Mat3b& image, const cv::Mat1b& mask, cv::Point corner, const cv::Scalar& ink) {
  const cv::Rect place = cv::Rect(corner, mask.size()) & cv::Rect({0, 0}, image.size());
  for (int row = place.y; row < place.br().y; ++row)
    for (int column = place.x; column < place.br().x; ++column) {
      const int cover = mask(row - corner.y, column - corner.x);
      for (int c = 0; c < 3; ++c) {
        auto& value = image(row, column)[c];
        value = cv::saturate_cast<unsigned char>(
            (value * (255 - cover) + static_cast<int>(ink[c]) * cover + 127) / 255);
      }
    }
}

constexpr int kMaskMargin = 6;  // room for what hangs under the base line

cv::Mat1b text_mask(const std::string& text, const Font& font) {
  const cv::Size size = text_size(text, font);
  cv::Mat1b mask(size.height + 2 * kMaskMargin, size.width + 2 * kMaskMargin, uchar{0});
  cv::putText(mask, text, {kMaskMargin, kMaskMargin + size.height}, font.face, font.size,
              cv::Scalar(255), 1, cv::LINE_AA);
  return mask;
}

enum class Align { kLeft, kCentre, kRight };

// `at`: the left end, middle or right end of the base line.
void put_text(cv::Mat3b& image, const std::string& text, cv::Point at, const Font& font,
              Align align = Align::kLeft) {
  const cv::Size size = text_size(text, font);
  if (align == Align::kCentre) at.x -= size.width / 2;
  if (align == Align::kRight) at.x -= size.width;
  blend(image, text_mask(text, font), at - cv::Point(kMaskMargin, size.height + kMaskMargin),
        font.ink);
}

// Reads upwards. `at`: the lower end of the line that halves the capitals.
void put_upright(cv::Mat3b& image, const std::string& text, cv::Point at, const Font& font) {
  const cv::Size size = text_size(text, font);
  cv::Mat1b mask;
  cv::rotate(text_mask(text, font), mask, cv::ROTATE_90_COUNTERCLOCKWISE);
  blend(image, mask, at - cv::Point(size.height / 2 + kMaskMargin, size.width + kMaskMargin),
        font.ink);
}

// Below one another; `at`: the top left corner.
void put_lines(cv::Mat3b& image, const std::vector<std::string>& lines, cv::Point at,
               const Font& font) {
  for (const auto& line : lines) {
    put_text(image, line, at + cv::Point(0, font.line * 7 / 10), font);
    at.y += font.line;
  }
}

// Title and subtitle over a chart or a panel.
struct Header {
  std::vector<std::string> title;
  std::vector<std::string> subtitle;

  Header(const std::string& title_text, const std::string& subtitle_text, int width)
      : title(wrapped(title_text, kTitleFont, width)),
        subtitle(wrapped(subtitle_text, kSubtitleFont, width)) {}

  int title_height() const { return static_cast<int>(title.size()) * kTitleFont.line; }
  int height() const {
    return title_height() + static_cast<int>(subtitle.size()) * kSubtitleFont.line;
  }
  void draw(cv::Mat3b& image, cv::Point corner) const {
    put_lines(image, title, corner, kTitleFont);
    put_lines(image, subtitle, corner + cv::Point(0, title_height()), kSubtitleFont);
  }
};

std::string number(double value, int decimals) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

// The power of ten at or below a positive value.
int decade(double value) {
  return static_cast<int>(std::floor(std::log10(value)));
}

std::string png(const cv::Mat3b& image) {
  std::vector<unsigned char> bytes;
  cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 6});
  return {bytes.begin(), bytes.end()};
}

// ---- bars

constexpr int kPlotHeight = 460;
constexpr int kMinPlotWidth = 420;
constexpr int kMinBar = 13;  // narrowest that an upright number fits over
constexpr int kMaxBar = 44;
constexpr int kMaxGroupName = 160;
constexpr int kMaxSeriesName = 320;
constexpr int kSwatch = 14;

// Continues the palette of labels: any two of the 24 differ by at least 17 in CIELAB for normal,
// protanopic and deuteranopic eyes, the first 14 by 23.
constexpr std::array<std::uint32_t, 12> kMoreColours = {0x401070, 0x0000FF, 0x5060FF, 0x402050,
                                                        0x409FAF, 0x707050, 0x60509F, 0x007070,
                                                        0x3040AF, 0x508FCF, 0x10DFAF, 0xBFBF30};
constexpr std::size_t kLabelColours = 12;

cv::Scalar series_colour(std::size_t series) {
  const std::size_t i = series % (kLabelColours + kMoreColours.size());
  if (i < kLabelColours) {
    const auto rgb = sink::palette(static_cast<std::int32_t>(i));
    return {255.0 * rgb[2], 255.0 * rgb[1], 255.0 * rgb[0]};
  }
  const std::uint32_t code = kMoreColours[i - kLabelColours];
  return {static_cast<double>(code & 0xFF), static_cast<double>(code >> 8 & 0xFF),
          static_cast<double>(code >> 16)};
}

// Of a series' colour, with a darker outline that keeps pale ones visible on white.
void fill_box(cv::Mat3b& image, cv::Rect box, const cv::Scalar& colour) {
  cv::rectangle(image, box, 0.6 * colour, cv::FILLED);
  const cv::Rect inside(box.x + 1, box.y + 1, box.width - 2, box.height - 2);
  if (inside.width > 0 && inside.height > 0) cv::rectangle(image, inside, colour, cv::FILLED);
}

double error_of(const Series& series, std::size_t group) {
  const double error = series.errors.empty() ? 0.0 : series.errors[group];
  return std::isnan(error) ? 0.0 : error;
}

bool has_error(const Series& series, std::size_t group) {
  return !series.errors.empty() && !std::isnan(series.errors[group]);
}

void check_series(const BarChart& chart, const Series& series) {
  const std::string who = "series '" + series.name + "' ";
  const auto counted = [&](const std::vector<double>& numbers, const std::string& what) {
    if (numbers.size() != chart.groups.size())
      throw ParameterError(who + "has " + std::to_string(numbers.size()) + " " + what + " for " +
                           std::to_string(chart.groups.size()) + " groups");
  };
  counted(series.values, "values");
  if (!series.errors.empty()) counted(series.errors, "errors");
  for (const double value : series.values) {
    if (std::isinf(value)) throw ParameterError(who + "has an infinite value");
    if (chart.logarithmic && value <= 0.0)
      throw ParameterError(who + "has a value on the logarithmic axis that is not positive");
  }
  for (const double error : series.errors)
    if (std::isinf(error) || error < 0.0)
      throw ParameterError(who + "has a standard error that is infinite or negative");
}

void check_bars(const BarChart& chart) {
  if (chart.groups.empty() || chart.series.empty())
    throw ParameterError("chart '" + chart.title + "' needs at least one group and one series");
  for (const auto& series : chart.series) check_series(chart, series);
}

// Calls `visit(series, group)` for every bar that there is.
void for_each_bar(const BarChart& chart, auto visit) {
  for (std::size_t g = 0; g < chart.groups.size(); ++g)
    for (std::size_t s = 0; s < chart.series.size(); ++s)
      if (!std::isnan(chart.series[s].values[g])) visit(s, g);
}

// What the numbers over the bars look like.
struct Labels {
  int decimals = 0;  // of a linear axis
  bool logarithmic = false;

  // Three digits each on a logarithmic axis, else as many decimals for all.
  std::string text(double value) const {
    return number(value, logarithmic ? std::clamp(2 - decade(value), 0, 9) : decimals);
  }
};

Labels labels_of(const BarChart& chart) {
  double largest = 0.0;
  for_each_bar(chart, [&](std::size_t s, std::size_t g) {
    largest = std::max(largest, std::abs(chart.series[s].values[g]));
  });
  const int decimals = largest > 0.0 ? 2 - decade(largest) : 0;
  return {.decimals = std::clamp(decimals, largest < 1000.0 ? 1 : 0, 9),
          .logarithmic = chart.logarithmic};
}

// The value axis: values as heights over the plot's lower edge, in [0, 1].
struct Axis {
  bool logarithmic;
  double low, high;  // at the edges of the plot; powers of ten if logarithmic

  double scale(double value) const {
    if (!logarithmic) return value;
    return value > 0.0 ? std::log10(value) : low;
  }
  double height(double value) const {
    return std::clamp((scale(value) - low) / (high - low), 0.0, 1.0);
  }
};

// `free` is the share of the height that stays free over the highest whisker, for its number.
Axis linear_axis(const BarChart& chart, double free) {
  double low = 0.0;
  double high = 0.0;
  for_each_bar(chart, [&](std::size_t s, std::size_t g) {
    const double value = chart.series[s].values[g];
    const double error = error_of(chart.series[s], g);
    low = std::min(low, value - error);
    high = std::max(high, value + error);
  });
  if (high == low) high = low + 1.0;
  return {.logarithmic = false, .low = low, .high = low + (high - low) / (1.0 - free)};
}

Axis logarithmic_axis(const BarChart& chart, double free) {
  std::optional<double> lowest;
  std::optional<double> highest;
  for_each_bar(chart, [&](std::size_t s, std::size_t g) {
    const double value = chart.series[s].values[g];
    lowest = std::min(lowest.value_or(value), value);
    const double top = value + error_of(chart.series[s], g);
    highest = std::max(highest.value_or(top), top);
  });
  // A bar whose value is a power of ten must not vanish.
  const double low = std::floor(std::log10(lowest.value_or(1.0)) - 0.1);
  const double high = std::max(std::log10(highest.value_or(1.0)), low + 1.0);
  return {.logarithmic = true, .low = low, .high = low + (high - low) / (1.0 - free)};
}

// Where bars start; on a logarithmic axis the lower edge.
constexpr double kBaseline = 0.0;

struct Tick {
  double value;
  std::string text;  // none: a fine line of a logarithmic axis
};

std::vector<Tick> linear_ticks(const Axis& axis) {
  const double rough = (axis.high - axis.low) / 8.0;
  const double unit = std::pow(10.0, decade(rough));
  double step = 10.0 * unit;
  for (const double factor : {5.0, 2.0, 1.0})
    if (factor * unit >= rough) step = factor * unit;
  const int decimals = std::max(0, -decade(step * 1.001));
  std::vector<Tick> ticks;
  for (double i = std::ceil(axis.low / step); i * step <= axis.high; ++i)
    ticks.push_back({i * step, number(i * step, decimals)});
  return ticks;
}

std::vector<Tick> logarithmic_ticks(const Axis& axis) {
  std::vector<Tick> ticks;
  for (int power = static_cast<int>(axis.low); power <= axis.high; ++power)
    for (int digit = 1; digit < 10; ++digit) {
      const double value = digit * std::pow(10.0, power);
      if (std::log10(value) > axis.high) break;
      ticks.push_back({value, digit == 1 ? number(value, std::max(0, -power)) : ""});
    }
  return ticks;
}

struct LegendLayout {
  int columns, rows;
  int width;  // of an entry
  int height() const { return rows * kLegendFont.line; }
};

LegendLayout legend_of(const std::vector<std::string>& names, int width) {
  const int count = static_cast<int>(names.size());
  const int entry = kSwatch + 8 + widest(names, kLegendFont) + 26;
  const int across = std::clamp(width / entry, 1, count);
  const int rows = (count + across - 1) / across;
  return {.columns = (count + rows - 1) / rows, .rows = rows, .width = entry};
}

struct BarLayout {
  int bar;    // from one bar to the next
  int group;  // from one group to the next
  bool upright;
  int number_height;  // from the top of a whisker to the top of its number
  int axis_width;     // of the numbers beside the axis
  cv::Rect plot;
  LegendLayout legend;
  cv::Size image;
};

std::vector<std::string> series_names(const BarChart& chart) {
  std::vector<std::string> names;
  for (const auto& series : chart.series) names.push_back(series.name);
  return shortened(std::move(names), kLegendFont, kMaxSeriesName);
}

std::vector<std::string> bar_texts(const BarChart& chart, const Labels& labels) {
  std::vector<std::string> texts;
  for_each_bar(chart, [&](std::size_t s, std::size_t g) {
    texts.push_back(labels.text(chart.series[s].values[g]));
  });
  return texts;
}

Axis axis_of(const BarChart& chart, const BarLayout& layout) {
  const double free = static_cast<double>(layout.number_height) / layout.plot.height;
  return chart.logarithmic ? logarithmic_axis(chart, free) : linear_axis(chart, free);
}

std::vector<Tick> ticks_of(const Axis& axis) {
  return axis.logarithmic ? logarithmic_ticks(axis) : linear_ticks(axis);
}

void lay_out_groups(const BarChart& chart, const Labels& labels, BarLayout& layout) {
  const int groups = static_cast<int>(chart.groups.size());
  const int series = static_cast<int>(chart.series.size());
  const int room = (kMaxWidth - 2 * kMargin - 100) / groups;  // 100: the axis
  constexpr int kGap = 26;
  layout.bar = std::clamp((room - kGap) / series, kMinBar, kMaxBar);
  const int bars = series * layout.bar + std::max(kGap, layout.bar);
  const int names = std::min(kMaxGroupName, widest(chart.groups, kGroupFont) + kGroupFont.line);
  layout.group = std::max({bars, std::min(names, room), kMinPlotWidth / groups});
  const int text = widest(bar_texts(chart, labels), kValueFont);
  layout.upright = text > layout.bar - 3;
  layout.number_height = 10 + (layout.upright ? text : kValueFont.line);
}

BarLayout layout_of(const BarChart& chart, const Labels& labels) {
  BarLayout layout{};
  lay_out_groups(chart, labels, layout);
  layout.plot = {0, 0, layout.group * static_cast<int>(chart.groups.size()), kPlotHeight};
  for (const auto& tick : ticks_of(axis_of(chart, layout)))
    layout.axis_width = std::max(layout.axis_width, text_width(tick.text, kTickFont) + 10);
  layout.plot.x = kMargin + layout.axis_width;
  layout.image.width = layout.plot.br().x + kMargin;
  layout.legend = legend_of(series_names(chart), layout.plot.width);
  const Header header(chart.title, chart.subtitle, layout.image.width - 2 * kMargin);
  layout.plot.y = kMargin + header.height() + (chart.unit.empty() ? 10 : kTickFont.line + 14);
  layout.image.height =
      layout.plot.br().y + kGroupFont.line + 20 + layout.legend.height() + kMargin;
  return layout;
}

int row_of(const BarLayout& layout, const Axis& axis, double value) {
  return layout.plot.br().y -
         static_cast<int>(std::lround(axis.height(value) * layout.plot.height));
}

void draw_axis(cv::Mat3b& image, const BarChart& chart, const BarLayout& layout, const Axis& axis) {
  const cv::Rect& plot = layout.plot;
  for (const auto& tick : ticks_of(axis)) {
    const int row = row_of(layout, axis, tick.value);
    cv::line(image, {plot.x, row}, {plot.br().x, row}, tick.text.empty() ? kFaintGrid : kGrid);
    put_text(image, tick.text, {plot.x - 8, row + 5}, kTickFont, Align::kRight);
  }
  const int base = row_of(layout, axis, kBaseline);
  cv::line(image, {plot.x, base}, {plot.br().x, base}, kFaintInk);
  put_text(image, chart.unit, {plot.x - 8, plot.y - 12}, kTickFont,
           text_width(chart.unit, kTickFont) < layout.axis_width ? Align::kRight : Align::kLeft);
}

// A light seam keeps it visible on dark bars.
void draw_whisker(cv::Mat3b& image, int column, int top, int bottom, int half_cap) {
  const auto lines = [&](int seam, const cv::Scalar& ink) {
    const auto box = [&](int left, int upper, int right, int lower) {
      cv::rectangle(image, {left - seam, upper - seam}, {right + seam, lower + seam}, ink,
                    cv::FILLED);
    };
    box(column - half_cap, top, column + half_cap, top);
    box(column - half_cap, bottom, column + half_cap, bottom);
    box(column, top, column, bottom);
  };
  lines(1, kPaper);
  lines(0, kInk);
}

void draw_bar(cv::Mat3b& image, const Series& series, std::size_t s, std::size_t group,
              const BarLayout& layout, const Axis& axis, const std::string& text, int left) {
  const double value = series.values[group];
  const int base = row_of(layout, axis, kBaseline);
  const int end = row_of(layout, axis, value);
  const int width = layout.bar - 2;
  const int height = std::max(1, std::abs(end - base));
  fill_box(image, {left + 1, std::min(base, end), width, height}, series_colour(s));
  const int column = left + layout.bar / 2;
  int top = std::min(base, end);
  if (has_error(series, group)) {
    const int upper = row_of(layout, axis, value + series.errors[group]);
    const int lower = row_of(layout, axis, value - series.errors[group]);
    draw_whisker(image, column, upper, lower, std::clamp(width / 5, 2, 5));
    top = std::min(top, upper);
  }
  if (layout.upright)
    put_upright(image, text, {column, top - 6}, kValueFont);
  else
    put_text(image, text, {column, top - 6}, kValueFont, Align::kCentre);
}

void draw_groups(cv::Mat3b& image, const BarChart& chart, const Labels& labels,
                 const BarLayout& layout, const Axis& axis) {
  const int bars = static_cast<int>(chart.series.size()) * layout.bar;
  const auto left = [&](std::size_t g) {
    return layout.plot.x + static_cast<int>(g) * layout.group;
  };
  for_each_bar(chart, [&](std::size_t s, std::size_t g) {
    const int at = left(g) + (layout.group - bars) / 2 + static_cast<int>(s) * layout.bar;
    const Series& series = chart.series[s];
    draw_bar(image, series, s, g, layout, axis, labels.text(series.values[g]), at);
  });
  for (std::size_t g = 0; g < chart.groups.size(); ++g)
    put_text(image, shortened(chart.groups[g], kGroupFont, layout.group - 12),
             {left(g) + layout.group / 2, layout.plot.br().y + kGroupFont.line}, kGroupFont,
             Align::kCentre);
}

void draw_legend(cv::Mat3b& image, const BarChart& chart, const BarLayout& layout) {
  const auto names = series_names(chart);
  const cv::Point corner(layout.plot.x, layout.plot.br().y + kGroupFont.line + 20);
  for (std::size_t s = 0; s < names.size(); ++s) {
    const int i = static_cast<int>(s);
    const cv::Point at = corner + cv::Point(i % layout.legend.columns * layout.legend.width,
                                            i / layout.legend.columns * kLegendFont.line);
    fill_box(image, {at.x, at.y + 5, kSwatch, kSwatch}, series_colour(s));
    put_text(image, names[s], at + cv::Point(kSwatch + 8, 17), kLegendFont);
  }
}

// ---- confusion matrices

constexpr int kPanelGap = 36;
constexpr int kMinCell = 28;  // narrowest that "100" fits into
constexpr int kMaxCell = 52;
constexpr int kMinPanel = 250;
constexpr int kMaxPanel = 560;
constexpr int kMaxLabelName = 110;
constexpr int kShareWidth = 62;  // of the rows' shares of all points
const char* const kConfusionCaption =
    "Rows: true label. Columns: given label. Cells: percent of the row's points. "
    "Beside a row: its percentage of all points.";

void check_matrix(const ConfusionMatrix& matrix) {
  const std::string who = "confusion matrix '" + matrix.title + "' ";
  const std::size_t count = matrix.names.size();
  if (count == 0) throw ParameterError(who + "has no labels");
  if (matrix.fraction.size() != count * count)
    throw ParameterError(who + "has " + std::to_string(matrix.fraction.size()) + " fractions for " +
                         std::to_string(count) + " names");
  for (const double fraction : matrix.fraction)
    if (!std::isfinite(fraction) || fraction < 0.0)
      throw ParameterError(who + "has a fraction that is negative or not finite");
  const double sum = std::accumulate(matrix.fraction.begin(), matrix.fraction.end(), 0.0);
  if (sum != 0.0 && std::abs(sum - 1.0) > 1e-6)
    throw ParameterError(who + "has fractions whose sum is " + number(sum, 6) + " and not 1");
}

double row_share(const ConfusionMatrix& matrix, std::size_t row) {
  const auto count = static_cast<std::ptrdiff_t>(matrix.names.size());
  const auto first = matrix.fraction.begin() + static_cast<std::ptrdiff_t>(row) * count;
  return std::accumulate(first, first + count, 0.0);
}

struct MatrixLayout {
  int names;  // width of the row names
  int cell;
  int width() const;  // of everything
  int count;
};

int MatrixLayout::width() const {
  return names + count * cell + kShareWidth;
}

// The largest cells that let the matrix fit into `width`, within bounds.
MatrixLayout matrix_layout(const ConfusionMatrix& matrix, int width) {
  const int count = static_cast<int>(matrix.names.size());
  const int names = widest(shortened(matrix.names, kTickFont, kMaxLabelName), kTickFont) + 8;
  const int cell = std::clamp((width - names - kShareWidth) / count, kMinCell, kMaxCell);
  return {.names = names, .cell = cell, .count = count};
}

// Names over the columns stand upright unless all fit.
bool names_fit_cells(const ConfusionMatrix& matrix, int cell) {
  return widest(matrix.names, kTickFont) <= cell - 4;
}

int column_names_height(const ConfusionMatrix& matrix, int cell) {
  if (names_fit_cells(matrix, cell)) return kTickFont.line;
  const auto names = shortened(matrix.names, kTickFont, kMaxLabelName);
  return widest(names, kTickFont) + 10;
}

// White over blue to dark blue.
cv::Scalar shade(double share) {
  const cv::Scalar middle(221, 121, 37);  // the first colour of labels
  const cv::Scalar dark(96, 40, 8);
  constexpr double kMiddle = 0.6;
  if (share < kMiddle) return kPaper + share / kMiddle * (middle - kPaper);
  return middle + (share - kMiddle) / (1.0 - kMiddle) * (dark - middle);
}

// Rounded, but not to a 0 or 100 that it is not; nothing for nothing.
std::string percent(double share) {
  if (share <= 0.0) return "";
  if (share < 0.005) return "<1";
  if (share < 1.0 && share >= 0.995) return ">99";
  return number(100.0 * share, 0);
}

void draw_cell(cv::Mat3b& image, cv::Rect box, double share) {
  cv::rectangle(image, box, shade(share), cv::FILLED);
  Font font = kValueFont;
  if (share > 0.4) font.ink = kPaper;
  if (share < 0.005) font.ink = kFaintInk;
  put_text(image, percent(share), {box.x + box.width / 2, box.y + box.height / 2 + 4}, font,
           Align::kCentre);
}

// `corner` is the matrix' own top left; row names are to its left, column names above.
void draw_matrix_text(cv::Mat3b& image, const ConfusionMatrix& matrix, const MatrixLayout& layout,
                      cv::Point corner) {
  const auto names = shortened(matrix.names, kTickFont, kMaxLabelName);
  const bool flat = names_fit_cells(matrix, layout.cell);
  for (int i = 0; i < layout.count; ++i) {
    const auto& name = names[static_cast<std::size_t>(i)];
    const int middle = i * layout.cell + layout.cell / 2;
    put_text(image, name, corner + cv::Point(-8, middle + 5), kTickFont, Align::kRight);
    if (flat)
      put_text(image, name, corner + cv::Point(middle, -7), kTickFont, Align::kCentre);
    else
      put_upright(image, name, corner + cv::Point(middle, -7), kTickFont);
    put_text(image, number(100.0 * row_share(matrix, static_cast<std::size_t>(i)), 1),
             corner + cv::Point(layout.count * layout.cell + kShareWidth - 12, middle + 5),
             kTickFont, Align::kRight);
  }
}

void draw_matrix(cv::Mat3b& image, const ConfusionMatrix& matrix, const MatrixLayout& layout,
                 cv::Point corner) {
  const int side = layout.count * layout.cell;
  for (int row = 0; row < layout.count; ++row) {
    const auto r = static_cast<std::size_t>(row);
    const double whole = row_share(matrix, r);
    for (int column = 0; column < layout.count; ++column) {
      const double part =
          matrix.fraction[r * matrix.names.size() + static_cast<std::size_t>(column)];
      const cv::Point at = corner + layout.cell * cv::Point(column, row);
      draw_cell(image, {at, cv::Size(layout.cell, layout.cell)}, whole > 0.0 ? part / whole : 0.0);
    }
  }
  for (int i = 0; i <= layout.count; ++i) {
    const int at = i * layout.cell;
    cv::line(image, corner + cv::Point(at, 0), corner + cv::Point(at, side), kGrid);
    cv::line(image, corner + cv::Point(0, at), corner + cv::Point(side, at), kGrid);
  }
  draw_matrix_text(image, matrix, layout, corner);
}

// A row of panels; their matrices start at the same height.
struct PanelRow {
  std::span<const ConfusionMatrix> matrices;
  std::vector<MatrixLayout> layout;
  std::vector<Header> header;
  int header_height = 0;  // with the column names
  int height = 0;
};

PanelRow panel_row(std::span<const ConfusionMatrix> matrices, int matrix_width, int width) {
  PanelRow row{.matrices = matrices};
  int tallest = 0;
  for (const auto& matrix : matrices) {
    row.layout.push_back(matrix_layout(matrix, matrix_width));
    row.header.emplace_back(matrix.title, matrix.subtitle, width);
    const int cell = row.layout.back().cell;
    row.header_height = std::max(
        row.header_height, row.header.back().height() + 6 + column_names_height(matrix, cell));
    tallest = std::max(tallest, row.layout.back().count * cell);
  }
  row.height = row.header_height + tallest;
  return row;
}

void draw_panel_row(cv::Mat3b& image, const PanelRow& row, cv::Point corner, int step) {
  for (std::size_t m = 0; m < row.matrices.size(); ++m) {
    row.header[m].draw(image, corner);
    draw_matrix(image, row.matrices[m], row.layout[m],
                corner + cv::Point(row.layout[m].names, row.header_height));
    corner.x += step;
  }
}

}  // namespace

std::string draw_bars(const BarChart& chart) {
  check_bars(chart);
  const Labels labels = labels_of(chart);
  const BarLayout layout = layout_of(chart, labels);
  const Axis axis = axis_of(chart, layout);
  cv::Mat3b image(layout.image, cv::Vec3b::all(255));
  const Header header(chart.title, chart.subtitle, layout.image.width - 2 * kMargin);
  header.draw(image, {kMargin, kMargin});
  draw_axis(image, chart, layout, axis);
  draw_groups(image, chart, labels, layout, axis);
  draw_legend(image, chart, layout);
  return png(image);
}

std::string draw_confusions(std::span<const ConfusionMatrix> matrices, int columns) {
  if (matrices.empty()) throw ParameterError("a picture needs at least one confusion matrix");
  if (columns < 1) throw ParameterError("columns: a picture needs at least one");
  for (const auto& matrix : matrices) check_matrix(matrix);
  const int across = std::min(columns, static_cast<int>(matrices.size()));
  const int matrix_width =
      std::min(kMaxPanel, (kMaxWidth - 2 * kMargin + kPanelGap) / across - kPanelGap);
  int panel = kMinPanel;
  for (const auto& matrix : matrices)
    panel = std::max(panel, matrix_layout(matrix, matrix_width).width());
  const int width = across * (panel + kPanelGap) - kPanelGap;
  std::vector<PanelRow> rows;
  int height = 0;
  for (auto left = matrices; !left.empty(); left = left.subspan(rows.back().matrices.size())) {
    const std::size_t count = std::min(left.size(), static_cast<std::size_t>(across));
    rows.push_back(panel_row(left.first(count), matrix_width, panel));
    height += rows.back().height + kPanelGap;
  }
  const auto caption = wrapped(kConfusionCaption, kSubtitleFont, width);
  height += static_cast<int>(caption.size()) * kSubtitleFont.line;
  cv::Mat3b image(height + 2 * kMargin, width + 2 * kMargin, cv::Vec3b::all(255));
  cv::Point corner(kMargin, kMargin);
  for (const auto& row : rows) {
    draw_panel_row(image, row, corner, panel + kPanelGap);
    corner.y += row.height + kPanelGap;
  }
  put_lines(image, caption, corner, kSubtitleFont);
  return png(image);
}

}  // namespace cosegraph::evaluation
