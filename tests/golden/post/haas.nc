%
O00001
(screenmill: VERSION, post haas, machine linuxcnc-mill)
(part: Kino _Saal 3_ ~ gr__e!)
(tile: r0c0)
(operation: finish)
(tool: T5 ball-1, ball D1 corner R0.5, 2 flutes)
(stick-out: 18 mm, neck 0.95 x 4 mm, shank 3.175 mm)
(stock: aluminium-6082 26 x 18.5 x 20 mm, 0.2 mm above the part)
(zero: X0 Y0 lower left corner of the tile, Z0 top of the stock)
(wcs: G54)
(units: mm, mm/min)
(bounds: X -0.5 to 2, Y 0 to 0.5, Z -0.012 to 5)
(feed: 320 mm/min, plunge 80 mm/min, 20000 rpm)
(estimated time:        not estimated)
(z: the tool's length offset has to be measured, X0 Y0 stay as they are)
(verify against your machine: travel, rate, motion, spindle, coolant)
(note: touch off Z anew after every tool, X and Y never)
(sha256 of all lines below:)
(- 18aef46ec672eec5b77063b3f93d4495cf909963f9384d472cbd448dc882fc3e)
G17 G21 G40 G49 G54 G80 G90 G94
G187 P3 E0.001
G91 G28 Z0.0
G90
T5 M6
S20000 M3
M8
G4 P3.0
G0 X-0.5 Y0.25
G0 G43 Z5.0 H5
(pass 1)
G0 X-0.5 Y0.25 Z5.0
Z0.5
G1 Z-0.012 F80.0
X1.0 Z-0.007 F320.0
X2.0
Y0.5
Z-0.009 F80.0
X0.0 F320.0
G0 Z5.0
(pass 2)
Y0.0
G1 Z-0.001 F80.0
X0.001 Y0.001 Z0.0 F320.0
G0 Z5.0
M5
M9
G91 G28 Z0.0
G28 Y0.0
G90
M30
%
