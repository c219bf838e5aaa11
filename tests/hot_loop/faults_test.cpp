// Faults allocate nothing after the start.
#include <gtest/gtest.h>

#include "emulator/config/load_config.hpp"
#include "emulator/faults/other_units.hpp"
#include "tests/emulator/faults/powered_unit.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "tests/support/allocations.hpp"

namespace imud {
namespace {

class FaultsAllocate : public RunTest {};

TEST_F(FaultsAllocate, NothingOnTheWire) {
  WireBench bench("native");
  std::vector<ActiveFault> active;
  for (std::uint32_t i = 0; i < WirePort::Line{}.most + 8; ++i)
    active.push_back(WireWindow{static_cast<WireFault>(i % wire_fault_kinds().size()), {0.1, 1, 1}, 0, 100, i}.at(0));
  std::erase_if(active, [](const ActiveFault& fault) { return wire_fault(*fault.kind) == WireFault::line_break; });
  ASSERT_GT(active.size(), WirePort::Line{}.most);
  bench.inner->keeps = false;
  const std::vector<std::byte> bytes(4);
  const Frame frame{bytes};
  const std::span<const ActiveFault> all = active;
  const std::uint64_t before = allocations();
  for (std::size_t i = 0; i <= all.size(); ++i) {
    bench.port->set_active(all.first(i));
    bench.port->send({&frame, 1});
  }
  for (std::size_t i = 0; i <= all.size(); ++i) {
    bench.port->set_active(all.subspan(i));
    bench.port->send({&frame, 1});
  }
  EXPECT_EQ(allocations() - before, 0U);
}

TEST_F(FaultsAllocate, NothingOnThePower) {
  PoweredUnit unit(write("config.toml", std::string(powered_unit_config)), true);
  unit.inner->keeps = false;
  const std::array<std::string_view, 5> names = {"off", "brown_out", "slow_start", "settings_lost", "boot_loader"};
  for (std::uint64_t k = 0; k < 2000; ++k) {
    const std::array<ActiveFault, 1> fault = {power_fault(names[k / 20 % 5], k % 20, 1)};
    const std::span<const ActiveFault> active =
        k % 20 < 10 ? std::span<const ActiveFault>(fault) : std::span<const ActiveFault>();
    const std::uint64_t before = allocations();
    unit.channel->set_power_faults(active);
    unit.step();
    ASSERT_EQ(allocations(), before) << k;
  }
}

TEST_F(FaultsAllocate, NothingInOtherUnits) {
  const Config config = load_config(write(
      "config.toml", std::string(powered_unit_config) + "[[fault]]\ntarget = \"message\"\nkind = \"other_settings\"\n"
                                                        "device = {cr_lf = true}\n"));
  const ImuConfig& imu = config.imus[0];
  OtherUnits units(imu.protocol->make(imu.settings), config.faults, imu, [](Device&) {});
  const auto frames = std::make_unique<FrameBuffer>();
  const std::string_view command = "SERVICEMODE\r";
  Sample sample;
  units.power_on(DeviceTime{});
  for (std::int64_t k = 0; k < 4000; ++k) {
    const std::uint64_t before = allocations();
    frames->clear();
    units.select(k / 100 % 2 == 0 ? std::optional<std::uint32_t>() : 0);
    sample.time = DeviceTime{500'000 * k};
    if (const auto at = units.deadline(); at && *at <= sample.time) units.poll(*at, *frames);
    units.sample(sample, *frames);
    if (k == 3500) units.receive({std::as_bytes(std::span(command))}, sample.time, *frames);
    ASSERT_EQ(allocations(), before) << k;
  }
}

}  // namespace
}  // namespace imud
