(screenmill: VERSION, post grbl, machine grbl-router)
(part: Kino _Saal 3_ _ gr__e_)
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
(z: set Z0 again whenever a tool has been fitted, leave X0 Y0 as they are)
(verify against your machine: travel, rate, motion, spindle, coolant)
(note: touch off Z anew after every tool, X and Y never)
(sha256 of all lines below:)
(- bb303731308534ae72b77fbc35185c3923703a5a022da8f49fc07e8974b5aaa1)
G17 G21 G40 G54 G90 G94
G0 Z5
M3 S20000
M8
G4 P3
(pass 1)
G0 X-0.5 Y0.25 Z5
Z0.5
G1 Z-0.012 F80
X1 Z-0.007 F320
X2
Y0.5
Z-0.009 F80
X0 F320
G0 Z5
(pass 2)
Y0
G1 Z-0.001 F80
X0.001 Y0.001 Z0 F320
G0 Z5
M5
M9
G0 X-0.5 Y0.5
M2
