% Plots Figure 7 from the MAT export of a run: position and duty over time, as a picture.
%
%   figure_7('run-1.mat', 'figure_7.svg')
%
% The file is that of `rheonaut export --run 1 --format mat --to run-1.mat`, or of the API's samples.mat. For Octave and
% MATLAB. Without a display Octave needs gnuplot:
%
%   octave-cli --path examples --eval "figure_7('run-1.mat', 'figure_7.svg')"
function figure_7(mat_file, picture)
  run = load(mat_file);
  t_s = (run.robot_time_us - run.robot_time_us(1)) * 1e-6;
  position_m = double(run.position_m);
  sd_m = double(run.position_sd_m);
  is_after_gap = run.gap_before > 0;  % samples are missing before: the lines are interrupted there

  plot_window = figure('visible', 'off');
  subplot(3, 1, [1 2]);
  hold('on');
  certain = isfinite(position_m) & isfinite(sd_m);
  band_t_s = [t_s(certain); flipud(t_s(certain))];
  band_m = [position_m(certain) + 2 * sd_m(certain); flipud(position_m(certain) - 2 * sd_m(certain))];
  fill(band_t_s, band_m, [0.85 0.87 0.88], 'edgecolor', 'none');
  plot(t_s, interrupted(run.setpoint_m, is_after_gap), '--', 'color', [0.69 0.09 0.44]);
  plot(t_s, interrupted(position_m, is_after_gap), 'color', [0.11 0.16 0.20]);
  ylabel('position (m)');
  legend('\pm 2 sd of the estimate', 'setpoint', 'position', 'location', 'southeast');
  title('Closed loop with a disturbance (Figure 7)');
  grid('on');

  subplot(3, 1, 3);
  plot(t_s, interrupted(run.duty, is_after_gap), 'color', [0.69 0.09 0.44]);
  ylabel('duty');
  xlabel('time (s)');
  grid('on');
  print(plot_window, picture, '-dsvg');
  close(plot_window);
  fprintf('%s\n', picture);
end

% The first sample after a gap is not drawn, so that no line crosses the gap.
function values = interrupted(values, is_after_gap)
  values = double(values);
  values(is_after_gap) = NaN;
end
