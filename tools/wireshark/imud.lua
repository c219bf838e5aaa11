-- A Wireshark dissector for records of imud (imud run --record FILE.pcapng): events, configuration, truth, and the
-- frames of the products on byte links. Frames on a CAN bus are left to Wireshark's own dissectors.
--
--   tshark -X lua_script:imud.lua -r FILE.pcapng
--
-- The layouts are those of transports/capture/record_packet.hpp, protocols/native_truth.hpp, protocols/devices/native.cpp,
-- protocols/stim300, protocols/mip and protocols/vectornav.

local record = Proto("imud", "imud record")
local truth = Proto("imud_truth", "imud truth datagram")

local function field(kind, name, text, ...)
  local one = ProtoField[kind]("imud." .. name, text, ...)
  record.fields[#record.fields + 1] = one
  return one
end

-- The name of the packet's interface, and whether it is that of the frames which a host sent or a port dropped.
local interface_name = Field.new("frame.interface_name")
local function interface_of_packet()
  local info = interface_name()
  return info and info.value or ""
end

-- Events -------------------------------------------------------------------------------------------------------------

local event_names = {
  "begin", "power_on", "power_cycle", "truth", "disconnected", "forget_past", "run", "set_clock", "start_samples",
  "advance", "sample", "transmit", "receive", "lost", "end", "command", "mark"
}
local bases = {[0] = "interpolated", "extrapolated", "held", [4] = "at rest"}
local outcomes = {[0] = "nothing", "ignored", "accepted", "inserted", "new run", "withheld"}
local commands = {
  [0] = "mark", "power_off", "power_on", "power_cycle", "pause", "resume", "seed", "gyro_bias", "accelerometer_bias",
  "delay", "automatic_delay", "extrapolate", "when_stopped", "log_level", "fault_begin", "fault_end", "fault_clear",
  "servo", "reload"
}
-- What the three numbers of an event are, by its name; "-": it has no such number.
local numbers = {
  begin = {"offset_ns", "file", "version"},
  power_on = {"host_time_ns"},
  power_cycle = {"host_time_ns", "polled_ns"},
  truth = {"truth_time_ns", "watermark_ns"},
  run = {"-", "polled_ns"},
  set_clock = {"device_time_ns", "host_time_ns"},
  advance = {"truth_time_ns"},
  sample = {"truth_time_ns", "newest_truth_ns", "index"},
  transmit = {"due_ns", "polled_ns"},
  receive = {"host_time_ns"},
  lost = {"packets"},
  ["end"] = {"-", "polled_ns"},
  command = {"host_time_ns", "value", "number"},
  mark = {"host_time_ns", "-", "number"}
}
local texts = {
  offset_ns = "Added to host times for the times of packets", file = "Number of the file", version = "Version",
  host_time_ns = "Host time", polled_ns = "Deadlines were polled up to", truth_time_ns = "Truth time",
  watermark_ns = "Watermark", device_time_ns = "Device time", newest_truth_ns = "Newest truth",
  index = "Number on the grid", due_ns = "Instant of the samples", packets = "Packets that are missing here",
  number = "Number"
}

local event_type = field("uint8", "event", "Event", base.DEC)
local event_name = field("string", "event.name", "Event")
local event_flags = field("uint8", "event.flags", "Flags", base.HEX)
local event_interface = field("uint16", "event.interface", "Interface of the imu", base.DEC)
local event_basis = field("string", "event.basis", "Basis of the motion")
local event_outcome = field("string", "event.outcome", "Outcome")
local event_command = field("string", "event.command", "Command")
local event_value = field("double", "event.value", "Value")
local event_numbers = {}
for name, text in pairs(texts) do event_numbers[name] = field("int64", "event." .. name, text, base.DEC) end
local note = field("string", "text", "Text")
local config_text = field("string", "config", "Configuration, TOML")

local function seconds(value) return string.format("%.6f s", value:tonumber() / 1e9) end

local function dissect_event(buffer, packet, tree)
  local kind = buffer(0, 1):uint()
  local name = event_names[kind]
  if buffer:len() ~= 32 or name == nil then  -- the text of the mark, or the keys of the fault, of the event before
    tree:add(note, buffer())
    packet.cols.info = "text: " .. buffer():string()
    return
  end
  tree:add_le(event_type, buffer(0, 1))
  tree:add(event_name, buffer(0, 1), name)
  tree:add_le(event_flags, buffer(1, 1))
  local flags, interface = buffer(1, 1):uint(), buffer(2, 2):le_uint()
  tree:add_le(event_interface, buffer(2, 2))
  local info = name
  if name == "sample" then
    tree:add(event_basis, buffer(1, 1), bases[flags] or "unknown")
    info = string.format("sample %s of interface %d, %s, truth time %s", tostring(buffer(24, 8):le_int64()),
                         interface, bases[flags] or "unknown", seconds(buffer(8, 8):le_int64()))
  elseif name == "truth" then
    tree:add(event_outcome, buffer(1, 1), outcomes[flags] or "unknown")
    info = string.format("truth %s, time %s", outcomes[flags] or "unknown", seconds(buffer(8, 8):le_int64()))
  elseif name == "command" then
    tree:add(event_command, buffer(1, 1), commands[flags] or "unknown")
    info = "command " .. (commands[flags] or "unknown")
  elseif name == "transmit" and flags % 2 == 1 then
    info = "transmit, skipped"
  end
  for i, what in ipairs(numbers[name] or {}) do
    local at = buffer(8 * i, 8)
    if what == "value" then
      tree:add_le(event_value, at)
    elseif what ~= "-" then
      tree:add_le(event_numbers[what], at)
    end
  end
  packet.cols.info = info
end

-- Products on byte links ---------------------------------------------------------------------------------------------

local protocol_name = field("string", "protocol", "Protocol")
local counter = field("uint32", "counter", "Counter", base.DEC)
local status = field("uint32", "status", "Status", base.HEX)
local time_ns = field("int64", "time_ns", "Device time, ns", base.DEC)
local temperature = field("double", "temperature_c", "Temperature, degrees Celsius")
local checksum = field("uint32", "checksum", "Checksum", base.HEX)
local quantities = {}
for name, text in pairs({
  rate = "Rate", specific_force = "Specific force", delta_angle = "Delta-angle", delta_velocity = "Delta-velocity",
  inclination = "Inclination", magnetic_field = "Magnetic field"
}) do
  quantities[name] = {}
  for i, axis in ipairs({"x", "y", "z"}) do
    quantities[name][i] = field("double", name .. "_" .. axis, text .. " " .. axis)
  end
end
local identifier = field("uint8", "stim300.id", "Identifier", base.HEX)
local latency = field("uint16", "stim300.latency_us", "Latency, us", base.DEC)
local descriptor_set = field("uint8", "mip.set", "Descriptor set", base.HEX)
local mip_field = field("bytes", "mip.field", "Field")
local groups = field("uint8", "vectornav.groups", "Groups", base.HEX)
local group_mask = field("uint16", "vectornav.fields", "Fields of the group", base.HEX)
local payload = field("bytes", "payload", "Content")

-- Adds three numbers; `read` gives the value of the i-th, from 0, in the unit that `unit` names.
local function add_vector(tree, name, range, unit, read)
  for i = 1, 3 do tree:add(quantities[name][i], range, read(i - 1)):append_text(" " .. unit) end
end

local function dissect_native(buffer, packet, tree)
  tree:add_le(counter, buffer(4, 4))
  tree:add_le(time_ns, buffer(8, 8))
  local at = 16
  for _, one in ipairs({{"rate", "rad/s"}, {"specific_force", "m/s^2"}, {"delta_angle", "rad"},
                        {"delta_velocity", "m/s"}}) do
    local range = buffer(at, 24)
    add_vector(tree, one[1], range, one[2], function(i) return range(8 * i, 8):le_float() end)
    at = at + 24
  end
  tree:add(temperature, buffer(112, 4), buffer(112, 4):le_float())
  tree:add_le(status, buffer(116, 4))
  tree:add_le(checksum, buffer(120, 4))
  packet.cols.info = string.format("native sample %d", buffer(4, 4):le_uint())
end

-- A signed number of 24 bits, big-endian.
local function int24(range)
  local value = range:uint()
  return value >= 0x800000 and value - 0x1000000 or value
end

-- Table 5-21 of the data sheet: bit 0 acceleration, 1 inclination, 2 temperature, 3 PPS or AUX.
local stim300_contents = {
  [0x90] = 0, [0x91] = 1, [0x92] = 2, [0x93] = 3, [0x94] = 4, [0xA5] = 5, [0xA6] = 6, [0xA7] = 7, [0x98] = 8,
  [0x99] = 9, [0x9A] = 10, [0x9B] = 11, [0x9C] = 12, [0xAD] = 13, [0xAE] = 14, [0xAF] = 15, [0xF0] = 8, [0xF1] = 9,
  [0xF2] = 10, [0xF3] = 11, [0xF4] = 12, [0xF5] = 13, [0xF6] = 14, [0xF7] = 15
}
local stim300_special = {
  [0xB1] = "part number", [0xB3] = "part number", [0xB5] = "serial number", [0xB7] = "serial number",
  [0xBC] = "configuration", [0xBD] = "configuration", [0xD1] = "bias trim offset", [0xD2] = "bias trim offset",
  [0xBE] = "errors", [0xBF] = "errors"
}

local function has(value, bit_number) return math.floor(value / 2 ^ bit_number) % 2 == 1 end

local function stim300_size(content)
  local clusters = 1 + (has(content, 0) and 1 or 0) + (has(content, 1) and 1 or 0)
  return 1 + 10 * clusters + (has(content, 2) and 7 * clusters or 0) + (has(content, 3) and 4 or 0) + 7
end

-- Units are those of a unit as delivered: only the configuration datagram names others.
local function dissect_stim300(buffer, packet, tree)
  local id = buffer(0, 1):uint()
  tree:add(identifier, buffer(0, 1))
  if stim300_special[id] ~= nil then
    tree:add(payload, buffer(1))
    packet.cols.info = "STIM300 " .. stim300_special[id]
    return
  end
  local content, at, bits = stim300_contents[id], 1, 0
  for i, one in ipairs({{"rate", "deg/s", 2 ^ -14}, {"specific_force", "g", 2 ^ -19}, {"inclination", "g", 2 ^ -22}}) do
    if i == 1 or has(content, i - 2) then
      local range, lsb = buffer(at, 9), one[3]
      add_vector(tree, one[1], range, one[2] .. ", as delivered", function(k) return int24(range(3 * k, 3)) * lsb end)
      tree:add(status, buffer(at + 9, 1), buffer(at + 9, 1):uint())
      bits = math.max(bits, buffer(at + 9, 1):uint())
      at = at + 10
    end
  end
  if has(content, 2) then tree:add(temperature, buffer(at, 2), buffer(at, 2):int() / 256) end
  local size = stim300_size(content)
  tree:add(counter, buffer(size - 7, 1))
  tree:add(latency, buffer(size - 6, 2))
  tree:add(checksum, buffer(size - 4, 4))
  packet.cols.info = string.format("STIM300 datagram %02X, counter %d, status %02X", id,
                                   buffer(size - 7, 1):uint(), bits)
end

-- The fields of the sensor set 0x80 that are three numbers.
local mip_vectors = {
  [0x04] = {"specific_force", "g"}, [0x05] = {"rate", "rad/s"}, [0x06] = {"magnetic_field", "gauss"},
  [0x07] = {"delta_angle", "rad"}, [0x08] = {"delta_velocity", "g s"}
}

local function dissect_mip(buffer, packet, tree)
  local set, size = buffer(2, 1):uint(), buffer(3, 1):uint()
  tree:add(descriptor_set, buffer(2, 1))
  local at, names = 4, {}
  while at + 2 <= 4 + size do
    local length, descriptor = buffer(at, 1):uint(), buffer(at + 1, 1):uint()
    if length < 2 or at + length > 4 + size then break end
    names[#names + 1] = string.format("%02X", descriptor)
    local item = tree:add(mip_field, buffer(at, length)):append_text(string.format(" (%02X/%02X)", set, descriptor))
    local vector = set == 0x80 and length == 14 and mip_vectors[descriptor]
    if vector then
      local range = buffer(at + 2, 12)
      add_vector(item, vector[1], range, vector[2], function(i) return range(4 * i, 4):float() end)
    end
    at = at + length
  end
  tree:add(checksum, buffer(4 + size, 2), buffer(4 + size, 2):uint())
  packet.cols.info = string.format("MIP %02X: %s", set, table.concat(names, " "))
end

-- Sizes of the fields of the common group, and where those with three numbers begin in them.
local common_sizes = {8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8}
local common_vectors = {
  [6] = {{"rate", "rad/s", 0}}, [9] = {{"specific_force", "m/s^2", 0}},
  [12] = {{"delta_angle", "deg", 4}, {"delta_velocity", "m/s", 16}}
}

local function dissect_vectornav_binary(buffer, packet, tree)
  local chosen, at, masks = buffer(1, 1):uint(), 2, {}
  tree:add(groups, buffer(1, 1))
  for group = 0, 6 do
    if has(chosen, group) then
      local mask = buffer(at, 2):le_uint()
      tree:add_le(group_mask, buffer(at, 2)):append_text(" (group " .. group + 1 .. ")")
      masks[#masks + 1] = string.format("%d:%04X", group + 1, mask)
      at = at + 2
    end
  end
  local fields = at
  if has(chosen, 0) then
    local mask = buffer(2, 2):le_uint()
    for i, size in ipairs(common_sizes) do
      if has(mask, i - 1) then
        if i == 1 then tree:add_le(time_ns, buffer(at, 8)) end
        for _, one in ipairs(common_vectors[i] or {}) do
          local range = buffer(at + one[3], 12)
          add_vector(tree, one[1], range, one[2], function(k) return range(4 * k, 4):le_float() end)
        end
        at = at + size
      end
    end
  end
  tree:add(payload, buffer(fields, buffer:len() - 2 - fields))
  tree:add(checksum, buffer(buffer:len() - 2, 2), buffer(buffer:len() - 2, 2):uint())
  packet.cols.info = "VectorNav " .. table.concat(masks, " ")
end

local function dissect_text(name)
  return function(buffer, packet, tree)
    tree:add(note, buffer())
    packet.cols.info = name .. " " .. buffer():string():gsub("[\r\n]+$", "")
  end
end

-- Returns the name of the protocol and the function that dissects a whole frame of it; nil if it is of none.
local function recognise(buffer)
  local size, first = buffer:len(), buffer(0, 1):uint()
  if size == 124 and buffer(0, 4):uint() == 0x494D017C then return "native", dissect_native end
  if size >= 6 and buffer(0, 2):uint() == 0x7565 and size == buffer(3, 1):uint() + 6 then return "MIP", dissect_mip end
  if first == 0x24 and buffer(0, 3):string() == "$VN" then return "VectorNav", dissect_text("VectorNav") end
  if first == 0xFA and size > 6 and buffer(1, 1):uint() < 0x80 then return "VectorNav", dissect_vectornav_binary end
  local content = stim300_contents[first]
  local is_measurement = content ~= nil and (size == stim300_size(content) or size == stim300_size(content) + 2)
  if is_measurement or stim300_special[first] ~= nil and size >= 20 and size <= 42 then
    return "STIM300", dissect_stim300
  end
end

-- The link types ------------------------------------------------------------------------------------------------------

local function begin(buffer, packet, tree)
  packet.cols.protocol = "imud"
  packet.cols.src = interface_of_packet()
  return tree:add(record, buffer())
end

local bytes = Proto("imud_bytes", "imud: bytes of a line")
function bytes.dissector(buffer, packet, tree)
  local subtree = begin(buffer, packet, tree)
  if buffer:len() == 0 then return end
  local name, dissect = recognise(buffer)
  if name == nil then
    local is_text = buffer():string():match("^[%g \t\r\n]+$") ~= nil
    subtree:add(payload, buffer())
    packet.cols.info = is_text and buffer():string():gsub("[\r\n]+", " ") or buffer:len() .. " bytes"
    return
  end
  subtree:add(protocol_name, buffer(0, 1), name)
  packet.cols.protocol = name
  dissect(buffer, packet, subtree)
end

local events = Proto("imud_events", "imud: events")
function events.dissector(buffer, packet, tree) dissect_event(buffer, packet, begin(buffer, packet, tree)) end

local config = Proto("imud_config", "imud: configuration")
function config.dissector(buffer, packet, tree)
  begin(buffer, packet, tree):add(config_text, buffer())
  packet.cols.info = "configuration, " .. buffer:len() .. " bytes of TOML"
end

local encapsulations = DissectorTable.get("wtap_encap")
encapsulations:add(wtap.USER0, bytes)
encapsulations:add(wtap.USER1, events)
encapsulations:add(wtap.USER2, config)

-- Truth ---------------------------------------------------------------------------------------------------------------

local function truth_field(kind, name, text, ...)
  local one = ProtoField[kind]("imud_truth." .. name, text, ...)
  truth.fields[#truth.fields + 1] = one
  return one
end
local truth_version = truth_field("uint16", "version", "Version", base.DEC)
local truth_flags = truth_field("uint16", "flags", "Flags", base.HEX)
local truth_stream = truth_field("uint32", "stream", "Stream", base.DEC)
local truth_sequence = truth_field("uint32", "sequence", "Sequence", base.DEC)
local truth_time = truth_field("int64", "time_ns", "Simulation time, ns", base.DEC)
local truth_samples = truth_field("uint64", "samples", "Samples in the run", base.DEC)
local truth_stamp = truth_field("int64", "stamp_ns", "Stamp of the simulation time, ns", base.DEC)
local truth_clock = truth_field("uint32", "stamp_clock", "Clock of the stamp", base.DEC,
                                {[0] = "none", [1] = "TAI", [2] = "UTC", [3] = "monotonic"})
local truth_checksum = truth_field("uint32", "checksum", "CRC-32C", base.HEX)
local truth_vectors = {}
for i, one in ipairs({
  {"r_BN_N", "Position, m"}, {"v_BN_N", "Velocity, m/s"}, {"sigma_BN", "Attitude, MRP"},
  {"omega_BN_B", "Rate, rad/s"}, {"omegaDot_BN_B", "Angular acceleration, rad/s^2"},
  {"specific_force_B", "Specific force, m/s^2"}, {"accumulated_dv", "Accumulated velocity, m/s"}
}) do
  truth_vectors[i] = {}
  for k, axis in ipairs({"x", "y", "z"}) do
    truth_vectors[i][k] = truth_field("double", one[1] .. "_" .. axis, one[2] .. " " .. axis)
  end
end

local function dissect_truth(buffer, packet, tree)
  local is_answer = buffer:len() == 32 and buffer(0, 4):string() == "IMUA"
  local is_truth = buffer:len() == 208 and buffer(0, 4):string() == "IMUT"
  if not is_answer and not is_truth then return false end
  packet.cols.protocol = "imud"
  local subtree = tree:add(truth, buffer())
  subtree:add_le(truth_version, buffer(4, 2))
  if is_truth then subtree:add_le(truth_flags, buffer(6, 2)) end
  subtree:add_le(truth_stream, buffer(8, 4))
  subtree:add_le(truth_sequence, buffer(12, 4))
  subtree:add_le(truth_time, buffer(16, 8))
  packet.cols.info = string.format("%s %d, time %s", is_truth and "truth" or "answer to truth",
                                   buffer(12, 4):le_uint(), seconds(buffer(16, 8):le_int64()))
  if is_answer then
    subtree:add_le(truth_samples, buffer(24, 8))
    return true
  end
  for i, vector in ipairs(truth_vectors) do
    for k, axis in ipairs(vector) do subtree:add_le(axis, buffer(24 * i + 8 * (k - 1), 8)) end
  end
  if buffer(4, 2):le_uint() == 2 then
    subtree:add_le(truth_stamp, buffer(192, 8))
    subtree:add_le(truth_clock, buffer(200, 4))
    subtree:add_le(truth_checksum, buffer(204, 4))
  else
    subtree:add_le(truth_checksum, buffer(196, 4))
  end
  return true
end
truth:register_heuristic("udp", dissect_truth)
