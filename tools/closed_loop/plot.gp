# Draws a run of run_loop.py: gnuplot -e "folder='closed_loop'; picture='closed_loop.png'" plot.gp
# For JSBSim, add: truth='jsbsim.csv'
degree = pi / 180
if (!exists("truth")) truth = "truth.csv"
is_jsbsim = truth eq "jsbsim.csv"
true = folder . "/" . truth
estimate = folder . "/estimate.csv"
every_nth = is_jsbsim ? 10 : 25      # of 50 Hz, or 250 Hz
time = is_jsbsim ? "Time" : "time_s"
angle(name, label) = is_jsbsim ? "/fdm/jsbsim/attitude/" . label . "-rad" : name
rate = is_jsbsim ? "/fdm/jsbsim/velocities/pi-rad_sec" : "omega_x"

set terminal pngcairo enhanced size 860,640 font 'sans,11'
set output picture
set datafile separator ","
set multiplot layout 3, 1 margins 0.075, 0.985, 0.075, 0.985 spacing 0, 0.04
set grid lc rgb '#dddddd'
set key inside top right samplen 2
set format x ""
set ylabel "roll, deg"
plot estimate using 'time_s':(column('wanted_roll')/degree) every 50 with lines lc rgb '#999999' dt 2 title "wanted", \
     true using time:(column(angle('roll', 'phi'))/degree) every every_nth with lines lw 4 lc rgb '#9ecae1' title "truth", \
     estimate using 'time_s':(column('roll')/degree) every 60 with lines lc rgb '#d62728' title "estimate"
set ylabel "pitch, deg"
plot estimate using 'time_s':(column('wanted_pitch')/degree) every 50 with lines lc rgb '#999999' dt 2 notitle, \
     true using time:(column(angle('pitch', 'theta'))/degree) every every_nth with lines lw 4 lc rgb '#9ecae1' notitle, \
     estimate using 'time_s':(column('pitch')/degree) every 60 with lines lc rgb '#d62728' notitle
set ylabel "roll rate, deg/s"
set xlabel "time, s"
set key bottom right
set format x "%g"
plot true using time:(column(rate)/degree) every every_nth with lines lw 4 lc rgb '#9ecae1' title "truth", \
     estimate using 'time_s':(column('gyro_x')/degree) every 50 with points pt 7 ps 0.25 lc rgb '#2ca02c' title "measurement"
unset multiplot
