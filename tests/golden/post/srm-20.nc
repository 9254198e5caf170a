%
O0001
(screenmill: VERSION, post roland-nc, machine roland-srm-20)
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
(feed: 112 mm/min, plunge 28 mm/min, 7000 rpm)
(estimated time:        not estimated)
(z: set Z0 again whenever a tool has been fitted, leave X0 Y0 as they are)
(verify against your machine: motion, spindle)
(note: touch off Z anew after every tool, X and Y never)
(sha256 of all lines below:)
(- 0fc57d0a254d9e8861382c86e9e7c7b9730c5f6b28b8bee8e108aa0f19cea623)
G90 G17
G21
G91
G28 Z0.0
G90
G54
G49
M3
G04 X3.0
G0 X-0.5 Y0.25
G0 Z5.0
(pass 1)
G0 X-0.5 Y0.25 Z5.0
Z0.5
G1 Z-0.012 F28.0
X1.0 Z-0.007 F112.0
X2.0
Y0.5
Z-0.009 F28.0
X0.0 F112.0
G0 Z5.0
(pass 2)
Y0.0
G1 Z-0.001 F28.0
X0.001 Y0.001 Z0.0 F112.0
G0 Z5.0
M5
G91
G28 Z0.0
G28 X0.0 Y0.0
G90
M30
%
