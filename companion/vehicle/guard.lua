-- Guard for rover-companion: HOLD when the companion falls silent while it drives the rover.
--
-- A velocity lasts three seconds in ArduRover, or GUID_TIMEOUT. Without this script a rover whose companion dies drives
-- on for as long.
-- It waits SCR_USER1 milliseconds (200 to 3000; 0: 300). It begins to watch with the companion's first setpoint in
-- GUIDED, and ends when the mode is another one or the rover is disarmed: so it never acts against a pilot, nor on a
-- companion that ended well. Twice a second it tells as CMPGRD191, the number being the component it watches, how long
-- it waits; negative while HOLD is its doing, and nobody else has asked for a mode or moved the mode switch since.
local COMPANION = 191
local GUIDED, HOLD = 15, 4
local HEARTBEAT = 0
local SETPOINTS = { [73] = true, [75] = true, [84] = true, [86] = true }
local SET_MODE, COMMAND_INT, COMMAND_LONG, DO_SET_MODE, DO_AUX_FUNCTION = 11, 75, 76, 176, 218
local SWITCHED_US = 100

local own = param:get("MAV_SYSID") or param:get("SYSID_THISMAV")
local watches, acted = false, false
local heard_ms, told_ms, switch_us = 0, 0, 0
local mode_channel = math.tointeger(param:get("MODE_CH") or 0)

local function waits_ms()
  local wanted = param:get("SCR_USER1") or 0
  if wanted <= 0 then return 300 end
  return math.min(math.max(wanted, 200), 3000)
end

local function asks_for_mode(message, id)
  if id == SET_MODE then return true end
  if (id ~= COMMAND_INT and id ~= COMMAND_LONG) or #message < 42 then return false end
  local command = string.unpack("<I2", message, 41)
  return command == DO_SET_MODE or command == DO_AUX_FUNCTION
end

local function mode_switch_us()
  return mode_channel and mode_channel > 0 and rc:get_pwm(mode_channel) or 0
end

local function listen(now_ms, guided)
  while true do
    local message = mavlink:receive_chan()
    if not message then return end
    local system, component, id = string.unpack("<BBI3", message, 8)
    if component == COMPANION and system == own then
      heard_ms, switch_us = now_ms, mode_switch_us()
      if guided and SETPOINTS[id] then watches = true end
    elseif asks_for_mode(message, id) then
      acted = false
    end
  end
end

local function update()
  local now_ms, mode = millis():toint(), vehicle:get_mode()
  local guided = arming:is_armed() and mode == GUIDED
  if not guided then watches = false end
  if mode ~= HOLD or not arming:is_armed() or math.abs(mode_switch_us() - switch_us) > SWITCHED_US then acted = false end
  listen(now_ms, guided)
  if watches and now_ms - heard_ms > waits_ms() then
    if vehicle:get_mode() == GUIDED and vehicle:set_mode(HOLD) then -- else again, 20 ms later
      watches, acted = false, true
      gcs:send_text(4, "Guard: companion silent, HOLD")
    end
  end
  if own and now_ms - told_ms >= 500 then
    told_ms = now_ms
    gcs:send_named_float("CMPGRD" .. COMPANION, acted and -waits_ms() or waits_ms())
  end
  return update, 20
end

mavlink:init(20, 7)
for _, id in ipairs({ HEARTBEAT, SET_MODE, COMMAND_LONG }) do mavlink:register_rx_msgid(id) end
for id in pairs(SETPOINTS) do mavlink:register_rx_msgid(id) end
return update()
