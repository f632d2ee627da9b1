// The style sheets and fonts of the page, in the order in which they build on each other.

import '@fontsource/b612/latin-400.css';
import '@fontsource/b612/latin-700.css';
import 'uplot/dist/uPlot.min.css';
import './style/ground.css';
import './style/shell.css';
import './style/top_bar.css';
import './style/status.css';
import './style/panels.css';
import './style/readouts.css';
import './style/vessel.css';
import './style/charts.css';
import './style/plots.css';
import './style/controls.css';
import './style/fleet.css';
import './style/runs.css';
import './style/run.css';
import './style/run_record.css';
import './style/experiments.css';
import './style/experiments_one.css';
import './style/experiments_queue.css';
import './style/design.css';
import './style/design_tables.css';
import './style/design_plots.css';
import './style/stop.css';
import './style/small_screens.css';
import './style/phone.css';
