"""The slots of urbiscript, of the robots and of their devices: names that no device of the settings may have.

Written by ``python tests/platforms/taken_names.py``; a test compares it with the slots there are.
"""

from __future__ import annotations

from typing import Final

_TEXT: Final = """
AX12 AXS1 AccelerationSensor AngleLimitServo AudioIn AudioOut Barrier Battery Binary Bioloid BlobDetector
CallMessage Chain Channel Code Comparable Component Container Control DGain Date Dictionary Directory DistanceSensor
Duration Enumeration Event Exception Executable Figure File Finalizable Float FormatInfo Formatter Global Group
GyroSensor IGain IP IRCenter IRLeft IRRight Identity InputStream Interface IoService Job Kernel1 Laser Lazy Led
LinearMotor LinearSpeedMotor List Loadable Lobby Localization Localizer Location Math Mobile Mobility MobilityWay
ModeServo MotionPlayer Motor Mutex Network Object Orderable OtherDevice OutputStream PGain PackageInfo Pair Path
Pattern Platform Position Primitive Process Profiling Promises PseudoLazy PubSub RGBLed RangeIterable Regexp
RegisterAccess RotationalMotor RotationalSpeedMotor Semaphore Sensor Server ServoDevices ServoTree Singleton Socket
SpeechRecognizer StackFrame String StructureEntry Subscription System Tag TaughtRobot TemperatureSensor TextToSpeech
Timeout TouchSensor Traceable Tracker TrajectoryGenerator Triplet Tuple UObject URTP UValue UVar VideoIn
WeakDictionary WeakPointer XServo abs acceleration acceptVoid acos addComponent addDevice addPose addProto age alarm
alarmLed aliveJobs allProtos allSlotNames angle answeredRegister applied apply arguments arity arrange as asBool
asIdentity asMotor asNetwork asObject asPrintable asRegisterAccess asRotationalMotor asServoTree asString
asTaughtRobot asToplevelPrintable asin askRegister assert assert_ assert_op atan atan2 attach back backtrace
baudRate beginMovement beginRecording bioloid blendSpeed blocked blockedFor body bounce branches briefNames busLoad
buzzerIndex buzzerTime callMessage ccwComplianceMargin ccwComplianceSlope ccwLimit cerr chain checkMotion
checkRecording clapCount clearStats clog clone cloneSlot completions controlTag copySlot cos cout createSlot current
cwComplianceMargin cwComplianceSlope cwLimit cycle dGain destroy detach deviceTable devices disown documentation
dropMotion dump dumpPart echo enableStats endMovement endPlaying endRecording endTeaching entries epoch estop
estopHolders eval evaluate exactNumbers exp external false feedForward1 feedForward2 figure figureGoals figureLinks
figureText fill firmware flatDump found fullName funCall gather getLocalSlot getPeriod getProperty getSlot getStats
getenv goalCurrent goalPwm grow growGroups growJoints guarded hasLocalSlot hasProperty hasSlot homingOffset iGain id
identify inf infrared infraredC infraredL infraredR init inspect interfaceNames interfaces isA isNil isProto isVoid
isdef jobs jobsText joinPart joint jointGroups jointName jointNames jointOrder keyPose leaveMotion led leftHand
light lightC lightCenter lightDetectedCenter lightDetectedLeft lightDetectedRight lightL lightLeft lightR lightRight
lightThreshold lightThresholdDefault limited limitedBy link linkBack linkJoints linkLost linkPose load loadFile
loadLibrary loadModule lobbies lobby localSlotNames locateSlot lock log logText logged lost makeCompactNames max
maxTorque maxVoltage maybeLoad methodToFunction min minVoltage missing mode model modelName modules motionBegun
motionEnded motionNames motionPages motionPlayer motions motorTable motors moving name nameOf named nan ndebug new
nextPose nil numbered obstacleCenter obstacleLeft obstacleRight obstacleThreshold obstacleThresholdDefault off on
overspeed overviewText ownName ownNames pGain pages parent part partNames period persist pi places planMotion play
playMelody playing pose poseNames poses print problems programName properties protos punch random rate readRegister
rearm reboot redefinitionMode refuseGroup refuseName refused registers rejoin releaseOf released remocon
remoconReceived removeLocalSlot removeProperty removeProto removeSlot requested resetLibrary returnDelay rightHand
robot round rtpOpen savePose savePoseFile scan scopeTag searchFile searchPath sensorTable sensors serial
setConstSlot setProperty setProtos setSlot setenv share shareLink shiftedTime shutdown sign signatureOf sin sleep
slotNames slotTable soundTime soundVolume soundVolumeMax spawn speed sqr sqrt srandom stale state statistics
statusReturnLevel step stop stopJob stopped stops storeNames syncGet system tan teach teaching tellJointsOff
tellRegister temperature temperatureLimit time timeReference torque torqueLimit tree treeKey treeText true trunc
turn type uid unacceptVoid unnotify unsetenv uobjects uobjects_handle updateSlot url uvalueSerialize val
velocityIGain velocityPGain version void voltage wall warn wheel why writeRegister
"""
TAKEN: Final = frozenset(_TEXT.split())
"""Names of slots."""
